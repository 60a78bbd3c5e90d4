// Rendered flights with several cameras, of which some fall silent or are covered for seconds; and settings that use
// only one. Derivation: docs/derivations/several_cameras.md.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/image_file.h"
#include "drivers/laboratory/factors/visual_factors.h"
#include "drivers/study/replay/replay.h"
#include "tests/flights/fault_run.h"
#include "tests/flights/small_flight.h"

namespace epiline {
namespace {

constexpr double kLength_s = 12, kFrom_s = 5, kTo_s = 8;
constexpr double kMostSigmas = 3;

struct Flown {
  test::FaultVerdict verdict;
  std::array<std::optional<SecondStats>, kMostOthers> others;
  double sigma_v = 0;  ///< m/s, the largest during the fault
  SecondStats second() const { return others[0].value_or(SecondStats{}); }
};

double largest_sigma_v(const std::vector<Odometry>& published, HostStamp zero) {
  double most = 0;
  for (const Odometry& o : published) {
    const double t = (o.stamp - zero).seconds();
    if (t < kFrom_s || t > kTo_s) continue;
    for (const std::size_t i : {6U, 7U, 8U}) most = std::max(most, std::sqrt(o.covariance[17 * i]));
  }
  return most;
}

Flown fly_recording(const std::filesystem::path& folder, const std::string& camera, const std::vector<Fault>& faults,
                    const std::function<void(AslDataset&)>& alter = {}, const std::vector<std::string>& set = {}) {
  test::PublishedOdometry published(1000);
  ReplayOptions options;
  options.dataset = folder;
  options.camera = camera;
  options.faults = faults;
  options.set = set;
  options.odometry = &published;
  HostStamp zero;
  options.alter = [&](AslDataset& d) {
    zero = d.images.front().stamp;
    if (alter) alter(d);
  };
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) {
    ADD_FAILURE() << result.error().text();
    return {};
  }
  Flown f{test::judge(published.all(), *result->record.truth, zero, {kFrom_s, kTo_s, kTo_s + 1}), result->record.others,
          largest_sigma_v(published.all(), zero)};
  std::cout << "error " << f.verdict.final_error_m << " m, worst " << f.verdict.worst_ratio << " sigma ("
            << f.verdict.worst_what << "), recovered after " << f.verdict.recovered_s << " s\n";
  for (const auto& other : f.others)
    if (other)
      std::cout << other->views << " views of " << other->tracks << ", " << other->alone << " of its own tracks, "
                << other->images_missing << " images missing\n";
  return f;
}

void expect_survived(const test::FaultVerdict& v) {
  ASSERT_TRUE(v.ran);
  EXPECT_EQ(v.resets, 0U);
  EXPECT_LT(v.worst_ratio, kMostSigmas) << v.worst_what << " at " << v.worst_at_s << " s";
  EXPECT_GE(v.recovered_s, 0);
  EXPECT_LT(v.recovered_s, 2);
}

/// Changes the images of another camera during the fault.
void alter_other(AslDataset& d, std::size_t number,
                 const std::function<void(std::vector<ImageFile>&, std::size_t)>& change) {
  AslDataset& other = *d.others[number - 1];
  for (std::size_t i = other.images.size(); i-- > 0;) {
    const double t = (other.images[i].stamp - d.images.front().stamp).seconds();
    if (t >= kFrom_s && t < kTo_s) change(other.images, i);
  }
  other.image_source = image_files(other.images, other.image_list);
}

std::filesystem::path black_image(const std::filesystem::path& folder) {
  std::ofstream black(folder / "black.pgm", std::ios::binary);
  black << "P5\n376 240\n255\n" << std::string(std::size_t{376} * 240, '\0');
  return folder / "black.pgm";
}

class TwoCameras : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::path(testing::TempDir()) / ("epiline_two_cameras_" + std::to_string(getpid()));
    const Status rendered = test::render_small_flight(folder_, kLength_s, test::second_camera(0.11));
    ASSERT_TRUE(rendered) << rendered.error().text();
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  static Flown fly(const std::vector<Fault>& faults, const std::function<void(AslDataset&)>& alter = {},
                   const std::vector<std::string>& set = {}, const std::filesystem::path& folder = folder_) {
    return fly_recording(folder, kBothCameras, faults, alter, set);
  }

  static std::filesystem::path folder_;
};
std::filesystem::path TwoCameras::folder_;

TEST_F(TwoCameras, WithoutAFaultBothSeeTheTracks) {
  const Flown f = fly({});
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_GT(f.second().views, f.second().tracks / 3);
}

TEST_F(TwoCameras, OfWhichTheFirstIsSilent) {
  const Flown f = fly({{FaultKind::kCameraSilent, kFrom_s, kTo_s - kFrom_s}});
  expect_survived(f.verdict);
  EXPECT_LT(f.verdict.final_error_m, 0.5);
}

/// Its own tracks carry the second camera through.
TEST_F(TwoCameras, OfWhichTheFirstIsCovered) {
  const Flown f = fly({{FaultKind::kCameraBlack, kFrom_s, kTo_s - kFrom_s}});
  expect_survived(f.verdict);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  const Flown without = fly({{FaultKind::kCameraBlack, kFrom_s, kTo_s - kFrom_s}}, {}, {"tracker.second_features=0"});
  EXPECT_EQ(without.second().alone, 0U);
  EXPECT_LT(f.sigma_v, 0.1);
  EXPECT_GT(without.sigma_v, 3 * f.sigma_v);
}

TEST_F(TwoCameras, OfWhichTheSecondIsSilent) {
  const Flown f = fly({}, [](AslDataset& d) {
    alter_other(d, 1, [](std::vector<ImageFile>& images, std::size_t i) {
      images.erase(images.begin() + static_cast<std::ptrdiff_t>(i));
    });
  });
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  EXPECT_EQ(f.second().images_missing, 60U);
}

TEST_F(TwoCameras, OfWhichTheSecondIsCovered) {
  const auto whole = fly({});
  const std::filesystem::path black = black_image(folder_);
  const Flown f = fly({}, [&](AslDataset& d) {
    alter_other(d, 1, [&](std::vector<ImageFile>& images, std::size_t i) { images[i].path = black; });
  });
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  EXPECT_LT(f.second().views, 0.85 * static_cast<double>(whole.second().views));
}

/// Two rolling shutters that nothing triggers together.
TEST_F(TwoCameras, ThatRunFreelyAreWorthAsMuchWithTheirTimes) {
  const std::filesystem::path free = folder_ / "free";
  constexpr double kLater_s = 0.02;
  const Status rendered =
      test::render_small_flight(free, 9, test::second_camera(0.11), kLater_s, ",rolling-shutter=42");
  ASSERT_TRUE(rendered) << rendered.error().text();
  const auto without_times = [](AslDataset& d) {
    for (std::size_t i = 0; i < d.images.size(); ++i) d.others[0]->images[i].stamp = d.images[i].stamp;
    d.others[0]->image_source = image_files(d.others[0]->images, d.others[0]->image_list);
  };
  const Flown f = fly({}, {}, {}, free), same = fly({}, without_times, {}, free);
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.05);
  EXPECT_GT(f.second().views, f.second().tracks / 3);
  EXPECT_GT(f.second().views, 2.9 * static_cast<double>(same.second().views)) << "2.6 times without the velocity";
}

TEST_F(TwoCameras, AreReportedAsOneWhereTheVisualFactorUsesOne) {
  const auto notes = [](const std::string& factor, const std::string& camera) {
    ReplayOptions options;
    options.dataset = folder_;
    options.camera = camera;
    options.duration_s = 0.2;
    options.tune = [&](Config& config) { choose_visual_factor(factor, config.estimator); };
    const auto result = replay(options, [](std::size_t, std::size_t) {});
    EXPECT_TRUE(result);
    return result ? result->notes : std::vector<std::string>{};
  };
  EXPECT_EQ(notes("track", kBothCameras).size(), 0U);
  for (const std::string factor : {"epipolar", "reprojection"}) {
    const auto said = notes(factor, kBothCameras);
    ASSERT_EQ(said.size(), 1U) << factor;
    EXPECT_NE(said[0].find("from cam0 alone"), std::string::npos) << said[0];
    EXPECT_NE(said[0].find(factor), std::string::npos) << said[0];
    EXPECT_EQ(notes(factor, "cam0").size(), 0U) << factor;
  }
}

/// One pair looks ahead, one back. Neither sees what the other one sees.
TEST(FourCameras, OfWhichThePairAheadIsCovered) {
  const auto folder = std::filesystem::path(testing::TempDir()) / ("epiline_four_cameras_" + std::to_string(getpid()));
  const Status rendered = test::render_small_flight(folder, kLength_s, test::pairs_ahead_and_back(0.11));
  ASSERT_TRUE(rendered) << rendered.error().text();
  const std::filesystem::path black = black_image(folder);
  const Flown f =
      fly_recording(folder, kAllCameras, {{FaultKind::kCameraBlack, kFrom_s, kTo_s - kFrom_s}}, [&](AslDataset& d) {
        ASSERT_EQ(d.others.size(), 3U);
        alter_other(d, 1, [&](std::vector<ImageFile>& images, std::size_t i) { images[i].path = black; });
      });
  expect_survived(f.verdict);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  EXPECT_LT(f.sigma_v, 0.1);
  for (const auto& other : f.others) ASSERT_TRUE(other);
  EXPECT_GT(f.others[0]->views, f.others[0]->tracks / 3);
  EXPECT_EQ(f.others[1]->views, 0U);
  EXPECT_GT(f.others[2]->views, f.others[2]->tracks / 3) << "of the tracks of the camera beside it";
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace epiline
