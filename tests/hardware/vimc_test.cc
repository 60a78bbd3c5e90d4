// The camera against the kernel's test driver vimc: sensors, converters and capture nodes in a media graph.
#include <linux/videodev2.h>

#include <filesystem>
#include <fstream>

#include "drivers/program/inventory/draft.h"
#include "drivers/program/inventory/parts.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "pipeline/config/config.h"
#include "tests/hardware/camera_support.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDriver = "/sys/bus/platform/drivers/vimc";

class Vimc : public testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(fs::path(kDriver) / "vimc.0"))
      GTEST_SKIP() << "the driver vimc is not loaded; expected ./run hardware";
  }
  static V4l2Settings settings(const char* node, int width, int height) {
    V4l2Settings settings = patient_settings();
    settings.device = node;
    settings.width = width;
    settings.height = height;
    return settings;
  }
  static std::string error(const V4l2Settings& settings) { return error_of_opening(V4l2Camera(settings)); }
  static void bind(const char* how) { std::ofstream(fs::path(kDriver) / how) << "vimc.0"; }
};

TEST_F(Vimc, ASensorAndItsNodeAreSetUpAlike) {
  V4l2Settings s = settings("Raw Capture 0", 160, 120);          // a mosaic, so the sensor gives 320 x 240
  s.controls = {{"test_pattern", 20}, {"show_information", 2}};  // the sensor's: the node has none
  V4l2Camera camera(s);
  ASSERT_OPENS(camera);
  EXPECT_TRUE(is_mosaic(camera.format().format));
  EXPECT_EQ(camera.format().width, 320);
  for (int i = 0; i < 5; ++i) {
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    EXPECT_EQ(frame.width, 160);
    EXPECT_EQ(frame.height, 120);
    EXPECT_GT(frame.data[150], frame.data[10] + 100) << "a ramp of grey";
    camera.give_back(frame);
  }
  camera.close();
  EXPECT_EQ(error(settings("Raw Capture 0", 320, 240)), "opened") << "another size, through the same graph";
}

// Size and format of the configuration that `epiline init` writes are the sensor's: it opens as it is.
TEST_F(Vimc, IsOpenedAsItsDraftSays) {
  Parts parts = find_parts();
  std::erase_if(parts.cameras, [](const CameraPart& camera) { return camera.name != "Raw Capture 0"; });
  ASSERT_EQ(parts.cameras.size(), 1u);
  const auto draft = draft_configuration(parts);
  ASSERT_TRUE(draft) << draft.error().text();
  const auto file = ConfigFile::parse(draft->toml, "draft.toml");
  ASSERT_TRUE(file) << draft->toml;
  Config config;
  file->apply(config);
  const auto wanted = v4l2_settings_of(config.devices.camera);
  ASSERT_TRUE(wanted);
  EXPECT_EQ(error(*wanted), "opened") << draft->toml;
}

/// Of a capture node beside the one in use, which the kernel wants set up alike.
void set_beside(const char* node, PixelFormat format, int width, int height) {
  V4l2Device device;
  ASSERT_FALSE(device.open(node, ""));
  v4l2_format wish{};
  wish.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  wish.fmt.pix.width = static_cast<std::uint32_t>(width);
  wish.fmt.pix.height = static_cast<std::uint32_t>(height);
  wish.fmt.pix.pixelformat = fourcc_of(format);
  ASSERT_EQ(device.call(VIDIOC_S_FMT, &wish), 0);
}

// Nothing leads to this node until a link to its scaler is enabled, and three sensors could.
TEST_F(Vimc, LinksAreSetForTheSensorThatIsNamed) {
  V4l2Settings s = settings("RGB/YUV Capture", 640, 480);
  EXPECT_NE(error(s).find("several sensors"), std::string::npos) << error(s);
  EXPECT_NE(error(s).find("\"Sensor A\", \"Sensor B\""), std::string::npos) << error(s);
  s.sensor = "Sensor C";
  EXPECT_NE(error(s).find("no sensor \"Sensor C\" leads to RGB/YUV Capture [camera.sensor]; expected "),
            std::string::npos)
      << error(s);
  // behind a converter, which makes colours of the mosaic; the first mosaic that the sensor lists is taken
  set_beside("Raw Capture 0", PixelFormat::kBggr8, 640, 480);
  set_beside("Raw Capture 1", PixelFormat::kBggr8, 640, 480);
  for (const char* sensor : {"Sensor B", "Sensor A", "RGB/YUV Input"}) {
    SCOPED_TRACE(sensor);
    s.sensor = sensor;
    V4l2Camera camera(s);
    ASSERT_OPENS(camera);
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    EXPECT_EQ(frame.width, 640);
    camera.give_back(frame);
  }
}

TEST_F(Vimc, ALostGraphIsSetUpAgain) {
  const int files = open_files();
  V4l2Camera camera(settings("Raw Capture 1", 160, 120));
  ASSERT_OPENS(camera);
  Frame frame;
  ASSERT_TRUE(read_within(camera, frame, kPatience));
  camera.give_back(frame);
  bind("unbind");
  ASSERT_TRUE(read_until(camera, [&] { return camera.counts().disconnected > 0 && camera.counts().retries > 0; }));
  bind("bind");
  ASSERT_TRUE(read_until(camera, [&] { return camera.is_streaming(); }));
  ASSERT_TRUE(read_within(camera, frame, kPatience));
  EXPECT_EQ(frame.width, 160);
  camera.give_back(frame);
  camera.close();
  EXPECT_EQ(open_files(), files);
}

TEST_F(Vimc, WhatTheGraphDoesNotOfferIsSaid) {
  V4l2Settings s = settings("Raw Capture 0", 160, 120);
  s.rate_hz = 30;
  EXPECT_NE(error(s).find("the camera's rate cannot be set [camera.rate_hz]; expected 0, which keeps the rate"),
            std::string::npos)
      << error(s);
  s.rate_hz = 0;
  s.formats = {PixelFormat::kGrey};
  EXPECT_NE(error(s).find("the camera does not offer 160x120 in GREY"), std::string::npos) << error(s);
}

}  // namespace
}  // namespace epiline
