#pragma once
// A recording of a camera and an IMU that stand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/program/record/recorder.h"
#include "tests/drivers/program/program.h"
#include "tests/drivers/program/standing_sensors.h"

namespace epiline::test {

class Recording : public testing::Test {
 protected:
  Recording() {
    settings.source = "record.toml";
    options.out = scratch();
    fs::remove_all(options.out);
    place<StandingCamera>();
    place_imu<StandingImu>();
  }
  ~Recording() override { fs::remove_all(options.out); }

  template <class C>
  C& place() {
    auto made = std::make_unique<C>();
    C& c = *made;
    camera = made.get();
    devices.camera = std::move(made);
    return c;
  }
  template <class I>
  I& place_imu() {
    auto made = std::make_unique<I>();
    I& i = *made;
    devices.imu = std::move(made);
    return i;
  }
  /// Until `is_enough`, at most a minute.
  Result<RecordSummary> run_until(const std::function<bool(const RecordState&)>& is_enough) {
    return record(settings, devices, options,
                  [&](const RecordState& state) { return !is_enough(state) && state.seconds < 60; });
  }
  RecordSummary recorded_until(const std::function<bool(const RecordState&)>& is_enough) {
    const auto r = run_until(is_enough);
    EXPECT_TRUE(r) << r.error().text();
    return r ? *r : RecordSummary{};
  }
  Error failure_until(const std::function<bool(const RecordState&)>& is_enough) {
    const auto r = run_until(is_enough);
    EXPECT_FALSE(r);
    return r ? Error{} : r.error();
  }
  fs::path root() const { return options.out / "mav0"; }
  std::size_t files_of_images() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(root() / "cam0/data"), {}));
  }
  /// What a recording must be at any instant: each listed image is whole, and each line is.
  void expect_readable(std::size_t fewest_images) const {
    for (const char* list : {"cam0/data.csv", "imu0/data.csv"}) {
      const std::string text = read(root() / list);
      ASSERT_FALSE(text.empty()) << list;
      EXPECT_EQ(text.back(), '\n') << list;
    }
    const auto dataset = open_uncalibrated_asl_dataset(options.out, "cam0");
    ASSERT_TRUE(dataset) << dataset.error().text();
    EXPECT_GE(dataset->images.size(), fewest_images);
    for (const ImageFile& image : dataset->images) {
      const cv::Mat pixels = cv::imread(image.path.string(), cv::IMREAD_UNCHANGED);
      EXPECT_EQ(pixels.cols, StandingCamera::kWidth) << image.path;
      EXPECT_EQ(pixels.rows, StandingCamera::kHeight) << image.path;
    }
  }

  LiveSettings settings;
  LiveDevices devices;
  RecordOptions options;
  StandingCamera* camera = nullptr;
};

}  // namespace epiline::test
