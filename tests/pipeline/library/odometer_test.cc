// The loop for samples that a caller pushes. That it flies as the command does, tests/package/consumer_test.sh shows.
#include "pipeline/library/odometer.h"

#include "tests/pipeline/stages/stage_support.h"

namespace epiline {
namespace {

using namespace test;

class OdometerTest : public testing::Test {
 protected:
  OdometerTest() {
    OfflineSettings settings;
    settings.camera = {CameraModel::kPinholeRadialTangential, 752, 480, {458, 457, 367, 248}, {}};
    settings.images = false;
    odometer = std::make_unique<Odometer>(settings);
    for (std::uint32_t id = 0; id < 60; ++id)
      points.push_back({id, 60 + 60 * static_cast<float>(id % 10), 50 + 60 * static_cast<float>(id / 10)});
  }
  bool push_image(std::int64_t ms) { return static_cast<bool>(odometer->push_tracks(at_ms(ms), points)); }
  bool push_imu(std::int64_t from_ms, std::int64_t until_ms) {
    bool all = true;
    for (; from_ms <= until_ms; ++from_ms) all = odometer->push_imu(reading_at(from_ms)) && all;
    return all;
  }

  std::vector<TrackPoint> points;
  std::unique_ptr<Odometer> odometer;
};

TEST_F(OdometerTest, AnImageWaitsForTheImuSamplesUpToIt) {
  EXPECT_FALSE(odometer->step());
  EXPECT_TRUE(push_imu(0, 40));
  EXPECT_TRUE(push_image(50));
  EXPECT_FALSE(odometer->step());
  EXPECT_TRUE(push_imu(41, 60));
  ASSERT_TRUE(odometer->step());
  EXPECT_EQ(odometer->outcome().stamp, at_ms(50));
  EXPECT_EQ(odometer->outcome().tracks, 60);
  EXPECT_FALSE(odometer->step());
}

TEST_F(OdometerTest, AfterTheEndNoImageWaits) {
  EXPECT_TRUE(push_image(50));
  EXPECT_TRUE(push_image(100));
  EXPECT_FALSE(odometer->step());
  odometer->end();
  EXPECT_TRUE(odometer->step());
  EXPECT_TRUE(odometer->step());
  EXPECT_EQ(odometer->outcome().stamp, at_ms(100));
  EXPECT_FALSE(odometer->step());
}

TEST_F(OdometerTest, ImagesThatAreOlderThanTheOneBeforeAreLeftOut) {
  EXPECT_TRUE(push_imu(0, 200));
  EXPECT_TRUE(push_image(100) && push_image(50) && push_image(150));
  ASSERT_TRUE(odometer->step());
  ASSERT_TRUE(odometer->step());
  EXPECT_EQ(odometer->outcome().stamp, at_ms(150));
  EXPECT_FALSE(odometer->step());
}

TEST_F(OdometerTest, WhatIsNotSteppedIsRefusedOnceThereIsNoRoom) {
  EXPECT_TRUE(push_imu(0, 9'999)) << "without an image, old samples make room";
  for (std::int64_t ms = 10'000; ms < 10'200; ms += 50) EXPECT_TRUE(push_image(ms));
  EXPECT_FALSE(push_image(10'200));
  const Status refused = odometer->push_imu(reading_at(10'000));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text(), "too many IMU samples wait; expected a step after each push");
  EXPECT_FALSE(odometer->step()) << "but takes what has come";
  EXPECT_TRUE(push_imu(10'000, 10'100));
  EXPECT_TRUE(odometer->step());
  EXPECT_TRUE(push_image(10'200));
}

TEST_F(OdometerTest, TakesNoMemoryOnceItIsMade) {
  const HeapCallScope heap;
  for (std::int64_t ms = 0; ms < 3'000; ms += 50) {
    EXPECT_TRUE(push_imu(ms, ms + 49));
    EXPECT_TRUE(push_image(ms));
    EXPECT_TRUE(odometer->push_wheel({at_ms(ms), 0.1}));
    EXPECT_TRUE(odometer->push_height({at_ms(ms), HeightKind::kBarometer, 1}));
    EXPECT_TRUE(odometer->step());
  }
  EXPECT_EQ(heap.calls(), 0);
}

TEST_F(OdometerTest, SettingsThatCannotBeFlownAreOneClearError) {
  const auto fault = [](const char* text) {
    const auto file = ConfigFile::parse(text, "settings");
    return file ? Odometer::create(*file, true).error().text() : file.error().text();
  };
  EXPECT_EQ(fault(""), "camera.calibration is not set; expected the name of the camera's calibration file");
  EXPECT_NE(fault("[camera]\ncalibration = '/none.yaml'").find("/none.yaml"), std::string::npos);
  EXPECT_EQ(fault("[camera]\ncalibration = '/none.yaml'\nmask = 'mask.png'"),
            "camera.mask is set; expected none: the library reads no image files");
}

}  // namespace
}  // namespace epiline
