#include "drivers/sensors/camera/v4l2_settings.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

CameraConfig good() {
  CameraConfig config;
  config.device = "/dev/video3";
  config.width = 640;
  config.height = 480;
  config.rate_hz = 29.97;
  config.format = "Y10P";
  config.controls = {{"auto_exposure", 1}, {"gain", 7}};
  config.shutter = 1;
  config.readout_ms = 12.5;
  config.exposure_control = "exposure_time_absolute";
  config.exposure_unit_ms = 0.1;
  config.stamp_point = 2;
  config.trust_stamps = true;
  config.silence_ms = 500;
  config.clock = 1;
  config.clock_hz = 48e6;
  config.exposure.automatic = true;
  config.exposure.gain_control = "gain";
  return config;
}

TEST(V4l2SettingsOf, TakesEveryEntryOver) {
  const auto settings = v4l2_settings_of(good());
  ASSERT_TRUE(settings) << settings.error().text();
  EXPECT_EQ(settings->device, "/dev/video3");
  EXPECT_EQ(settings->width, 640);
  EXPECT_EQ(settings->height, 480);
  EXPECT_DOUBLE_EQ(settings->rate_hz, 29.97);
  EXPECT_EQ(settings->formats, std::vector<PixelFormat>{PixelFormat::kY10P});
  ASSERT_EQ(settings->controls.size(), 2u);
  EXPECT_EQ(settings->controls[1].name, "gain");
  EXPECT_EQ(settings->controls[1].value, 7);
  EXPECT_EQ(settings->shutter, Shutter::kRolling);
  EXPECT_EQ(settings->readout.ns, 12'500'000);
  EXPECT_EQ(settings->exposure_control, "exposure_time_absolute");
  EXPECT_EQ(settings->exposure.ns, 100'000) << "of 1 in the control";
  EXPECT_EQ(settings->stamp_point, StampPoint::kEndOfFrame);
  EXPECT_TRUE(settings->trust_stamps);
  EXPECT_TRUE(settings->uses_own_clock);
  EXPECT_EQ(settings->clock_hz, 48'000'000u);
  EXPECT_EQ(settings->silence_most.ns, 500'000'000);
  EXPECT_TRUE(settings->control_of_exposure.automatic);
}

TEST(V4l2SettingsOf, WithoutAControlTheExposureIsTheConfiguredOne) {
  CameraConfig config = good();
  config.exposure = {};
  config.exposure_control = "";
  config.exposure_ms = 4;
  config.format = "";
  config.stamp_point = 0;
  const auto settings = v4l2_settings_of(config);
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->exposure.ns, 4'000'000);
  EXPECT_EQ(settings->formats.front(), PixelFormat::kGrey);
  EXPECT_EQ(settings->formats.size(), static_cast<std::size_t>(PixelFormat::kCount));
  EXPECT_TRUE(is_grey_in_place(settings->formats[2])) << "NV12 and YU12 need no copy";
  EXPECT_EQ(settings->formats.back(), PixelFormat::kMjpeg) << "what costs most";
  EXPECT_FALSE(settings->stamp_point);
}

TEST(V4l2SettingsOf, SaysWhatMakesNoSense) {
  const auto error = [](auto change) {
    CameraConfig config = good();
    change(config);
    const auto settings = v4l2_settings_of(config);
    return settings ? "taken" : settings.error().text();
  };
  EXPECT_EQ(error([](CameraConfig& c) { c.device = ""; }),
            "camera.device: no camera; expected a path, a name or a bus");
  EXPECT_EQ(error([](CameraConfig& c) { c.format = "H264"; }),
            "camera.format: \"H264\"; expected GREY, Y10, Y12, Y16, Y10P, Y12P, YUYV, NV12, YU12, RGB3, BGR3, BA81, "
            "GBRG, GRBG, RGGB, "
            "BG10, GB10, BA10, RG10, pBAA, pGAA, pgAA, pRAA, BG12, GB12, BA12, RG12, pBCC, pGCC, pgCC, pRCC, BYR2, "
            "GB16, GR16, RG16, MJPG");
  EXPECT_EQ(error([](CameraConfig& c) { c.readout_ms = 0; }),
            "camera.readout_ms: 0 with a rolling shutter; expected the sensor's, from its data sheet");
  EXPECT_EQ(error([](CameraConfig& c) {
              c.controls.push_back({"gain", 8});
            }),
            "camera.controls: \"gain\" twice; expected each once");
  EXPECT_EQ(error([](CameraConfig& c) { c.exposure_control = ""; }),
            "exposure.automatic: true without camera.exposure_control; expected the control that sets the exposure");
}

}  // namespace
}  // namespace epiline
