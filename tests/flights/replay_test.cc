// Recorded flights through the whole pipeline. The bands are what the estimator has to reach, not what it happened to
// do.
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/outputs.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <string>

#include "drivers/study/report/flight_record.h"
#include "drivers/study/report/stats_json.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

/// A replay of a whole data set.
struct Outcome {
  FlightRecord record;
  TrajectoryErrors errors;
  double time_offset_s = 0;  ///< t_IMU - t_image as estimated at the end
};

Outcome replay_all(const std::string& dataset, double shift_images_ms, int perturb = 0) {
  ReplayOptions options;
  options.dataset = dataset;
  options.shift_images_ms = shift_images_ms;
  options.perturb = perturb;
  auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) {
    ADD_FAILURE() << result.error().text();
    return {};
  }
  Outcome outcome{.record = std::move(result->record), .errors = {}};
  if (outcome.record.truth) outcome.errors = evaluate(trajectory_of(outcome.record), *outcome.record.truth);
  for (const ImageRecord& image : outcome.record.images)
    if (image.has_pose) outcome.time_offset_s = image.time_offset_s;
  return outcome;
}

std::string file_text(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string trajectory_text(const FlightRecord& record, const std::string& name) {
  const auto folder = std::filesystem::path(testing::TempDir()) / (name + "_" + std::to_string(getpid()));
  if (const auto written = write_outputs(record, folder); !written) ADD_FAILURE() << written.error().text();
  std::string text = file_text(folder / "trajectory.tum");
  std::filesystem::remove_all(folder);
  return text;
}

class RecordedFlight : public testing::Test {
 protected:
  void need(const std::string& dataset) {
    folder_ = test::recorded_data(dataset);
    if (!std::filesystem::exists(folder_)) GTEST_SKIP() << folder_ << " is not here";
  }
  /// Each replay once for all tests of the process.
  const Outcome& outcome(double shift_images_ms = 0) {
    static std::map<std::pair<std::string, double>, Outcome> known;
    const auto key = std::make_pair(folder_, shift_images_ms);
    if (!known.contains(key)) known.emplace(key, replay_all(folder_, shift_images_ms));
    return known.at(key);
  }
  std::string folder_;
};

/// The rotors of EuRoC's V1_01 spin up: its samples scatter by up to 1.3 m/s^2 and 0.1 rad/s, its images by 0.1 px, and
/// it moves by 2.6 mm.
TEST_F(RecordedFlight, StandsWhileItsMotorsRun) {
  need("euroc_V1_01_motors");
  for (const int perturb : {0, 1, 3, 5}) {
    if (IsSkipped()) return;
    SCOPED_TRACE(perturb);
    const FlightRecord record = replay_all(folder_, 0, perturb).record;
    const auto seconds = start_seconds(record);
    ASSERT_TRUE(seconds.has_value());
    EXPECT_LE(*seconds, 0.65);
    std::optional<Vec3> first;
    double farthest_m = 0;
    for (const ImageRecord& image : record.images) {
      if (!image.has_pose) continue;
      if (!first) first = image.pose.p_WB;
      farthest_m = std::max(farthest_m, (image.pose.p_WB - *first).norm());
    }
    EXPECT_GT(farthest_m, 0);
    EXPECT_LE(farthest_m, 0.008);
  }
}

/// A GoPro on a drone, begun in flight. The speed of the drone's controller is good to some percent.
TEST_F(RecordedFlight, OfAGoProHasTheSpeedOfItsDrone) {
  need("gopro_karma");
  if (IsSkipped()) return;
  const FlightRecord record = replay_all(folder_, 0).record;
  const auto seconds = start_seconds(record);
  ASSERT_TRUE(seconds.has_value());
  EXPECT_LE(*seconds, 4);
  ASSERT_TRUE(record.truth.has_value());
  const Trajectory& truth = *record.truth;
  ASSERT_EQ(truth.v_WB_m_s.size(), truth.poses.size());
  int judged = 0;
  for (const ImageRecord& image : record.images) {
    if (!image.has_pose || (image.stamp - record.images.front().stamp).seconds() < 6) continue;
    const auto after = std::lower_bound(truth.poses.begin(), truth.poses.end(), image.stamp,
                                        [](const TimedPose& pose, HostStamp t) { return pose.stamp < t; });
    if (after == truth.poses.end()) continue;
    const double speed = image.v_WB_m_s.norm(),
                 expected = truth.v_WB_m_s[static_cast<std::size_t>(after - truth.poses.begin())].norm(),
                 sigma = image.sigma_v_m_s.cwiseProduct(image.v_WB_m_s).norm() / speed;
    EXPECT_LT(std::abs(speed - expected), std::min(3 * sigma, 0.15 * expected) + 0.05)
        << (image.stamp - record.images.front().stamp).seconds() << " s";
    ++judged;
  }
  EXPECT_GT(judged, 100);
}

/// EuRoC MH_01_easy: 15 s of sweeps, then standing still.
class MachineHall : public RecordedFlight {
 protected:
  void SetUp() override { need("euroc_MH_01"); }
};

TEST_F(MachineHall, StartsSoonAndIsNeverReset) {
  const auto seconds = start_seconds(outcome().record);
  ASSERT_TRUE(seconds.has_value());
  EXPECT_LE(*seconds, 1.0);
  EXPECT_EQ(outcome().record.estimator.resets, 0u);
  EXPECT_EQ(coverage(outcome().record), 1.0);
}

TEST_F(MachineHall, IsAccurate) {
  EXPECT_GT(outcome().errors.poses, 500u);
  EXPECT_LE(outcome().errors.ate_4dof.rmse, 0.006);
}

/// docs/derivations/zero_motion.md
TEST_F(MachineHall, StandsStillWhereTheBodyStands) {
  constexpr HostStamp kBegin{1403636601'000'000'000},
      kEnd{1403636610'500'000'000};  // set down at 599.9, bumped at 610.8
  std::optional<Vec3> where;
  double drift_m = 0;
  for (const ImageRecord& image : outcome().record.images) {
    if (!image.has_pose || image.stamp < kBegin || image.stamp > kEnd) continue;
    if (!where) where = image.pose.p_WB;
    drift_m = std::max(drift_m, (image.pose.p_WB - *where).norm());
  }
  ASSERT_TRUE(where.has_value());
  EXPECT_GT(drift_m, 0);
  EXPECT_LE(drift_m, 0.003);
}

TEST_F(MachineHall, FindsATimeOffset) {
  for (const double shift_ms : {-5.0, 5.0}) {
    SCOPED_TRACE(shift_ms);
    const Outcome& shifted = outcome(shift_ms);
    // against what the recording itself shows: its own offset is not known to a millisecond
    EXPECT_NEAR(1e3 * (shifted.time_offset_s - outcome().time_offset_s), -shift_ms, 1.0);
    EXPECT_LE(shifted.errors.ate_4dof.rmse, 0.007);
  }
}

TEST_F(MachineHall, IsTheSameEveryTime) {
  const std::string first = trajectory_text(outcome().record, "epiline_replay_first");
  const std::string second = trajectory_text(replay_all(folder_, 0).record, "epiline_replay_second");
  EXPECT_GT(first.size(), 10'000u);
  EXPECT_TRUE(first == second);  // not EXPECT_EQ: nobody wants to read the difference
}

TEST_F(MachineHall, UsesNoHeap) {
  if (!outcome().record.heap_calls) GTEST_SKIP() << "heap calls are not counted in this build";
  EXPECT_EQ(*outcome().record.heap_calls, 0u);
}

/// Corner tracks of an AprilGrid, no images. The ground truth is not gravity-aligned.
class AprilGrid : public RecordedFlight {
 protected:
  void SetUp() override { need("imu_april_tracks"); }
};

TEST_F(AprilGrid, IsAccurate) {
  EXPECT_GT(outcome().errors.poses, 500u);
  EXPECT_EQ(outcome().record.estimator.resets, 0u);
  EXPECT_LE(outcome().errors.ate_se3.rmse, 0.05);
  EXPECT_LE(std::abs(outcome().errors.scale_error), 0.03);
}

}  // namespace
}  // namespace epiline
