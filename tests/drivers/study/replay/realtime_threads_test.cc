// A replay in threads must come to the same result as the replay in one thread, bit by bit, as long as no image is left
// out. These run under the thread sanitizer too.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "drivers/laboratory/simulate/asl_writer.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"

/// Asked by the thread sanitizer: libgdal, which comes with OpenCV's image files, takes its own locks in both orders.
extern "C" const char*
__tsan_default_suppressions() {  // NOLINT(readability-identifier-naming,bugprone-reserved-identifier)
  return "deadlock:libgdal\n";
}

namespace epiline {
namespace {

namespace fs = std::filesystem;

#ifdef EPILINE_SANITIZED
constexpr double kSpeed = 1;
#else
constexpr double kSpeed = 4;
#endif

class RealtimeReplay : public testing::Test {
 protected:
  void SetUp() override {
    std::string name("epiline_realtime_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::replace(name.begin(), name.end(), '/', '_');
    folder_ = fs::path(testing::TempDir()) / name;
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    // a busy computer is no reason to give up on a reading
    std::ofstream(folder_ / "patient.toml") << "[realtime]\nimu_wait_ms = 5000\ndeadline_ms = 0\n";
    options_.dataset = folder_ / "flight";
    options_.config_file = folder_ / "patient.toml";
  }
  void TearDown() override { fs::remove_all(folder_); }

  FlightRecord fly(std::optional<double> speed) {
    options_.realtime_speed = speed;
    auto result = replay(options_, [](std::size_t, std::size_t) {});
    if (!result) {
      ADD_FAILURE() << result.error().text();
      return {};
    }
    return std::move(result->record);
  }

  static std::uint64_t skipped(const FlightRecord& record) {
    std::uint64_t sum = 0;
    for (const auto& reason : record.skipped) sum += reason.second;
    return sum;
  }

  /// In threads, without a loss: a computer that had no time for us for a while gets another chance.
  FlightRecord fly_without_loss(std::uint64_t skipped_anyway) {
    FlightRecord record;
    for (int tries = 0; tries < 3; ++tries) {
      record = fly(kSpeed);
      if (skipped(record) == skipped_anyway) break;
    }
    return record;
  }

  static void expect_equal(const FlightRecord& a, const FlightRecord& b) {
    ASSERT_EQ(a.images.size(), b.images.size());
    for (std::size_t i = 0; i < a.images.size(); ++i) {
      const ImageRecord &x = a.images[i], &y = b.images[i];
      ASSERT_EQ(x.stamp, y.stamp);
      ASSERT_EQ(x.has_pose, y.has_pose) << i;
      ASSERT_EQ(x.solved, y.solved) << i;
      ASSERT_EQ(x.keyframe, y.keyframe) << i;
      ASSERT_EQ(x.tracks, y.tracks) << i;
      ASSERT_EQ(x.new_tracks, y.new_tracks) << i;
      if (!x.has_pose) continue;
      ASSERT_EQ(x.pose.p_WB, y.pose.p_WB) << i;
      ASSERT_EQ(x.pose.q_WB.coeffs(), y.pose.q_WB.coeffs()) << i;
      ASSERT_EQ(x.v_WB_m_s, y.v_WB_m_s) << i;
      ASSERT_EQ(x.uncertainty.position, y.uncertainty.position) << i;
      ASSERT_EQ(x.time_offset_s, y.time_offset_s) << i;
      ASSERT_TRUE(y.latency_ms.has_value() || i + 1 < a.images.size()) << i;
    }
  }

  /// Every image is accounted for, and so is every estimate.
  static void expect_consistent(const FlightRecord& record) {
    ASSERT_TRUE(record.realtime.has_value());
    const RealtimeReport& report = record.realtime->report;
    EXPECT_EQ(report.frames_in, report.frames_out + report.frames_overtaken + report.frames_refused);
    EXPECT_EQ(record.images_read, record.images.size() + skipped(record) - record.skipped.at("refused_by_estimator"));
    EXPECT_EQ(record.images.size(), report.frames_out);
    EXPECT_EQ(record.estimator.frames, report.frames_out);
    EXPECT_EQ(report.published + report.superseded, report.frames_out);
    EXPECT_LE(record.estimator.imu_samples, report.imu_in);
  }

  fs::path folder_;
  ReplayOptions options_;
};

class RealtimeReplayOfTracks : public RealtimeReplay, public testing::WithParamInterface<FlightKind> {};

// A start at rest shows a reading too many, a start in motion one that is missing.
TEST_P(RealtimeReplayOfTracks, IsTheReplayInOneThread) {
  TrackSimulation simulation;
  simulation.flight = GetParam();
  simulation.time_offset_s = 0.003;
  simulation.noise.pixel_sigma = 0.3;
  ASSERT_TRUE(write_asl(simulation, simulate_tracks(simulation), options_.dataset));
  options_.duration_s = 6;
  const FlightRecord offline = fly(std::nullopt);
  ASSERT_GT(trajectory_of(offline).poses.size(), 80u);
  const FlightRecord threads = fly_without_loss(0);
  EXPECT_EQ(skipped(threads), 0);
  expect_equal(offline, threads);
  expect_consistent(threads);
}

INSTANTIATE_TEST_SUITE_P(All, RealtimeReplayOfTracks, testing::Values(FlightKind::kAgile, FlightKind::kStandstill),
                         [](const auto& flight) { return std::string(to_string(flight.param)); });

/// Images of a random texture that moves: something to track, whatever it may mean.
void write_textured_flight(const fs::path& folder) {
  constexpr int kWidth = 160, kHeight = 120, kImages = 40, kMargin = 64;
  constexpr std::int64_t kStart_ns = 1'000'000'000'000;
  const fs::path mav = folder / "mav0";
  fs::create_directories(mav / "cam0/data");
  fs::create_directories(mav / "imu0");
  std::ofstream(mav / "cam0/sensor.yaml")
      << "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [160, 120]\n"
         "camera_model: pinhole\nintrinsics: [120, 120, 80, 60]\ndistortion_model: none\ndistortion_coefficients: []\n";
  std::mt19937 random(7);
  std::array<std::array<unsigned char, kWidth + kMargin>, kHeight> texture;
  for (std::size_t y = 0; y < kHeight; ++y) {
    for (std::size_t x = 0; x < kWidth + kMargin; ++x) {
      const bool new_patch = x % 5 == 0 && y % 5 == 0;
      texture[y][x] = new_patch ? static_cast<unsigned char>(random() % 256) : texture[y - y % 5][x - x % 5];
    }
  }
  std::ofstream list(mav / "cam0/data.csv"), imu(mav / "imu0/data.csv");
  for (int i = 0; i < kImages; ++i) {
    // one image twice, one out of order: both replays leave them out
    const std::int64_t ns = kStart_ns + (i == 10 ? 9 : i == 20 ? 17 : i) * 50'000'000LL;
    const std::string name = std::to_string(i) + ".pgm";
    list << ns << "," << name << "\n";
    std::ofstream image(mav / "cam0/data" / name, std::ios::binary);
    image << "P5\n" << kWidth << " " << kHeight << "\n255\n";
    for (const auto& row : texture) image.write(reinterpret_cast<const char*>(row.data()) + i, kWidth);
  }
  for (int i = -20; i < 10 * kImages; ++i)
    imu << kStart_ns + i * 5'000'000LL << ",0.01," << 0.02 + 0.001 * (i % 7) << ",0.03,0.01,0.02,9.81\n";
}

TEST_F(RealtimeReplay, OfImagesIsTheReplayInOneThread) {
  write_textured_flight(options_.dataset);
  const FlightRecord offline = fly(std::nullopt);
  EXPECT_EQ(skipped(offline), 2);
  ASSERT_EQ(offline.images.size(), 38u);
  EXPECT_GT(offline.images.back().tracks, 10);
  const FlightRecord threads = fly_without_loss(2);
  EXPECT_EQ(skipped(threads), 2);
  expect_equal(offline, threads);
  expect_consistent(threads);
}

// Far too fast for the computer: images are lost, where and why is counted, and nothing breaks.
TEST_F(RealtimeReplay, TooFastLosesImagesAndCountsThem) {
  write_textured_flight(options_.dataset);
  const FlightRecord threads = fly(1000);
  EXPECT_GT(skipped(threads), 2);
  expect_consistent(threads);
}

TEST_F(RealtimeReplay, AnImageThatCannotBeReadIsLeftOut) {
  write_textured_flight(options_.dataset);
  std::ofstream(options_.dataset / "mav0/cam0/data/35.pgm") << "no image";
  options_.realtime_speed = 4;
  const auto result = replay(options_, [](std::size_t, std::size_t) {});
  ASSERT_TRUE(result) << result.error().text();
  EXPECT_EQ(result->record.skipped.at("unreadable"), 1u);
  ASSERT_FALSE(result->notes.empty());
  EXPECT_NE(result->notes.back().find("data.csv:36: "), std::string::npos) << result->notes.back();
}

TEST_F(RealtimeReplay, AnImuThatEndsEarlyHoldsNothingUp) {
  write_textured_flight(options_.dataset);
  std::ifstream in(options_.dataset / "mav0/imu0/data.csv");
  std::string text, line;
  for (int i = 0; i < 150 && std::getline(in, line); ++i) text += line + "\n";
  in.close();
  std::ofstream(options_.dataset / "mav0/imu0/data.csv") << text;
  const FlightRecord offline = fly(std::nullopt), threads = fly_without_loss(2);
  expect_equal(offline, threads);
  EXPECT_EQ(threads.realtime->report.imu_late, 0) << "the end of the IMU is known, not waited for";
}

}  // namespace
}  // namespace epiline
