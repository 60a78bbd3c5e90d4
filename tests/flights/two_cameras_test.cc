// A rendered flight with two cameras, of which one falls silent or is covered for seconds; and settings that use only
// one. Derivation: docs/derivations/several_cameras.md.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <string>
#include <vector>

#include "drivers/flights/recordings/image_file.h"
#include "drivers/study/replay/replay.h"
#include "tests/flights/fault_run.h"
#include "tests/flights/small_flight.h"

namespace epiline {
namespace {

constexpr double kFlight_s = 12, kFrom_s = 5, kTo_s = 8;
constexpr double kSigmas = 3;

class TwoCameras : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::path(testing::TempDir()) / ("epiline_two_cameras_" + std::to_string(getpid()));
    const Status rendered = test::render_small_flight(folder_, kFlight_s, 0.11);
    ASSERT_TRUE(rendered) << rendered.error().text();
    std::ofstream black(folder_ / "black.pgm", std::ios::binary);
    black << "P5\n376 240\n255\n" << std::string(std::size_t{376} * 240, '\0');
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  struct Flown {
    test::FaultVerdict verdict;
    SecondStats second;
    double sigma_v = 0;  ///< m/s, the largest during the fault
  };
  static double largest_sigma_v(const std::vector<Odometry>& published, HostStamp zero) {
    double most = 0;
    for (const Odometry& o : published) {
      const double t = (o.stamp - zero).seconds();
      if (t < kFrom_s || t > kTo_s) continue;
      for (const std::size_t i : {6U, 7U, 8U}) most = std::max(most, std::sqrt(o.covariance[17 * i]));
    }
    return most;
  }
  static Flown fly(const std::vector<Fault>& faults, const std::function<void(AslDataset&)>& alter = {},
                   const std::vector<std::string>& set = {}, const std::filesystem::path& folder = folder_) {
    test::PublishedOdometry published(1000);
    ReplayOptions options;
    options.dataset = folder;
    options.camera = kBothCameras;
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
    Flown f{test::judge(published.all(), *result->record.truth, zero, {kFrom_s, kTo_s, kTo_s + 1}),
            *result->record.second, largest_sigma_v(published.all(), zero)};
    std::cout << "error " << f.verdict.final_error_m << " m, worst " << f.verdict.worst_ratio << " sigma ("
              << f.verdict.worst_what << "), recovered after " << f.verdict.recovered_s << " s, " << f.second.views
              << " views of the second camera, " << f.second.images_missing << " of its images missing\n";
    return f;
  }
  static void expect_survived(const test::FaultVerdict& v) {
    ASSERT_TRUE(v.ran);
    EXPECT_EQ(v.resets, 0U);
    EXPECT_LT(v.worst_ratio, kSigmas) << v.worst_what << " at " << v.worst_at_s << " s";
    EXPECT_GE(v.recovered_s, 0);
    EXPECT_LT(v.recovered_s, 2);
  }
  /// Changes the second camera's images of the silence.
  static void alter_second(AslDataset& d, const std::function<void(std::vector<ImageFile>&, std::size_t)>& change) {
    AslDataset& second = *d.second;
    for (std::size_t i = second.images.size(); i-- > 0;) {
      const double t = (second.images[i].stamp - d.images.front().stamp).seconds();
      if (t >= kFrom_s && t < kTo_s) change(second.images, i);
    }
    second.image_source = image_files(second.images, second.image_list);
  }

  static std::filesystem::path folder_;
};
std::filesystem::path TwoCameras::folder_;

TEST_F(TwoCameras, WithoutAFaultBothSeeTheTracks) {
  const Flown f = fly({});
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_GT(f.second.views, f.second.tracks / 3);
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
  EXPECT_EQ(without.second.alone, 0U);
  EXPECT_LT(f.sigma_v, 0.1);
  EXPECT_GT(without.sigma_v, 3 * f.sigma_v);
}

TEST_F(TwoCameras, OfWhichTheSecondIsSilent) {
  const Flown f = fly({}, [](AslDataset& d) {
    alter_second(d, [](std::vector<ImageFile>& images, std::size_t i) {
      images.erase(images.begin() + static_cast<std::ptrdiff_t>(i));
    });
  });
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  EXPECT_EQ(f.second.images_missing, 60U);
}

TEST_F(TwoCameras, OfWhichTheSecondIsCovered) {
  const auto whole = fly({});
  const Flown f = fly({}, [](AslDataset& d) {
    alter_second(d, [](std::vector<ImageFile>& images, std::size_t i) { images[i].path = folder_ / "black.pgm"; });
  });
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.1);
  EXPECT_LT(f.second.views, 0.85 * static_cast<double>(whole.second.views));
}

/// Two rolling shutters that nothing triggers together.
TEST_F(TwoCameras, ThatRunFreelyAreWorthAsMuchWithTheirTimes) {
  const std::filesystem::path free = folder_ / "free";
  constexpr double kLater_s = 0.02;
  const Status rendered = test::render_small_flight(free, 9, 0.11, kLater_s, ",rolling-shutter=42");
  ASSERT_TRUE(rendered) << rendered.error().text();
  const auto without_times = [](AslDataset& d) {
    for (std::size_t i = 0; i < d.images.size(); ++i) d.second->images[i].stamp = d.images[i].stamp;
    d.second->image_source = image_files(d.second->images, d.second->image_list);
  };
  const Flown f = fly({}, {}, {}, free), same = fly({}, without_times, {}, free);
  expect_survived(f.verdict);
  EXPECT_EQ(f.verdict.not_tracking_s, 0);
  EXPECT_LT(f.verdict.final_error_m, 0.05);
  EXPECT_GT(f.second.views, f.second.tracks / 3);
  EXPECT_GT(f.second.views, 2.9 * static_cast<double>(same.second.views)) << "2.6 times without the velocity";
}

TEST_F(TwoCameras, AreReportedAsOneWhereTheSettingsUseOne) {
  const auto notes = [](std::vector<std::string> set, const std::string& camera) {
    ReplayOptions options;
    options.dataset = folder_;
    options.camera = camera;
    options.duration_s = 0.2;
    options.set = std::move(set);
    const auto result = replay(options, [](std::size_t, std::size_t) {});
    EXPECT_TRUE(result);
    return result ? result->notes : std::vector<std::string>{};
  };
  EXPECT_EQ(notes({}, kBothCameras).size(), 0U);
  for (const std::string setting : {"estimator.visual_factor=\"epipolar\"", "estimator.visual_factor=\"reprojection\"",
                                    "estimator.track_noise=\"white\""}) {
    const auto said = notes({setting}, kBothCameras);
    ASSERT_EQ(said.size(), 1U) << setting;
    EXPECT_NE(said[0].find("cam1 is not used"), std::string::npos) << said[0];
    EXPECT_EQ(notes({setting}, "cam0").size(), 0U) << setting;
  }
}

}  // namespace
}  // namespace epiline
