// `epiline init` on made-up parts: what it chooses, and that the configuration's own reader takes it.
#include "drivers/program/inventory/draft.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "drivers/program/inventory/camera_mode.h"
#include "drivers/sensors/camera/v4l2_settings.h"
#include "pipeline/config/config.h"
#include "pipeline/text/table.h"
#include "tests/drivers/program/must.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using test::must;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

CameraSize size(unsigned width, unsigned height, std::vector<double> rates_hz) {
  return {width, height, width, height, std::move(rates_hz), false};
}

CameraPart camera(const std::string& path, std::vector<CameraFormat> formats) {
  CameraPart part;
  part.path = path;
  part.name = "Made-up Cam";
  part.settings = {{"camera.device", "Made-up Cam"}};
  part.formats = std::move(formats);
  return part;
}

ImuPart imu(const std::string& path, const std::string& name, bool gyroscope, bool accelerometer) {
  ImuPart part;
  part.path = path;
  part.name = name;
  part.has_gyroscope = gyroscope;
  part.has_accelerometer = accelerometer;
  part.settings = {{gyroscope ? "imu.device" : "imu.device_accel", name}};
  return part;
}

SerialPart port(const std::string& path, const std::string& autopilot) {
  SerialPart part;
  part.path = path;
  part.autopilot = autopilot;
  part.settings = {{"mavlink.serial", path}};
  return part;
}

/// As the program would read the draft.
Config config_of(const Draft& draft) {
  Config config;
  must(ConfigFile::parse(draft.toml, "draft.toml")).apply(config);
  return config;
}

Draft draft_of(const Parts& parts) { return must(draft_configuration(parts)); }

const CameraFormat kYuyv640{"YUYV", true, false, {size(640, 480, {15, 30}), size(1280, 800, {10})}};
const CameraFormat kMjpeg{"MJPG", true, false, {size(1280, 720, {60})}},
    kH264{"H264", false, false, {size(1280, 720, {60})}};

TEST(Draft, NothingPluggedInIsSaid) {
  const auto draft = draft_configuration({});
  ASSERT_FALSE(draft);
  EXPECT_EQ(draft.error().kind, ErrorKind::kRun);
  EXPECT_THAT(draft.error().text(), HasSubstr("neither a camera nor anything with an IMU is plugged in"));
}

TEST(Draft, WhatIsMissingIsACommentToFillIn) {
  Parts parts;
  parts.cameras = {camera("/dev/video0", {kH264})};
  parts.cameras[0].trouble = "epiline reads none of its formats";
  parts.spi.resize(1);
  parts.spi[0].path = "/dev/spidev0.1";
  const Draft draft = draft_of(parts);
  const Config config = config_of(draft);
  EXPECT_EQ(config.devices.camera.device, "");
  EXPECT_EQ(config.devices.imu.device, "");
  EXPECT_THAT(draft.toml, HasSubstr("# /dev/video0: epiline reads none of its formats\n#device = "));
  EXPECT_THAT(draft.toml, HasSubstr("#device = \"/dev/spidev0.1\""));
  EXPECT_THAT(draft.chosen, IsEmpty());
  EXPECT_EQ(draft.missing.size(), 2u);
  // filled in, it is a configuration too
  std::string filled = draft.toml;
  for (std::size_t at = 0; (at = filled.find("\n#", at)) != std::string::npos; ++at)
    if (filled[at + 2] != ' ') filled.erase(at + 1, 1);
  EXPECT_TRUE(ConfigFile::parse(filled, "filled.toml")) << filled;
}

TEST(Draft, AWholeRigIsChosen) {
  Parts parts;
  parts.cameras = {camera("/dev/video0", {kMjpeg, kYuyv640}),
                   camera("/dev/video2", {{"GREY", true, false, {size(1280, 800, {120}), size(640, 400, {120, 30})}}})};
  parts.cameras[1].lasting_path = "/dev/v4l/by-path/platform-csi";
  parts.imus = {imu("/dev/iio:device0", "gyro", true, false), imu("/dev/iio:device1", "accel", false, true)};
  parts.imus[0].rates_hz = {12.5, 50, 100, 208, 833};
  parts.serial = {port("/dev/ttyUSB0", ""), port("/dev/ttyACM0", "Holybro flight controller")};
  parts.can.resize(1);
  parts.can[0].path = "can0";
  const Draft draft = draft_of(parts);
  const Config config = config_of(draft);
  const CameraConfig& c = config.devices.camera;
  EXPECT_EQ(c.device, "/dev/v4l/by-path/platform-csi");
  EXPECT_EQ(c.format, "GREY");
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.height, 400);
  EXPECT_EQ(c.rate_hz, 30);
  EXPECT_TRUE(v4l2_settings_of(c)) << "the driver takes it";
  EXPECT_EQ(config.devices.imu.device, "gyro");
  EXPECT_EQ(config.devices.imu.device_accel, "accel");
  EXPECT_EQ(config.devices.imu.rate_hz, 208);
  EXPECT_EQ(config.devices.mavlink.serial, "/dev/ttyACM0");
  EXPECT_EQ(config.devices.can.interface, "") << "one receiver is enough; nothing is sent on an unknown bus";
  EXPECT_EQ(config.camera_calibration, "") << "there is none yet";
  EXPECT_THAT(draft.toml, HasSubstr("Others: /dev/video0 (Made-up Cam)"));
  EXPECT_THAT(draft.toml, HasSubstr("\n#interface = \"can0\""));
  EXPECT_THAT(draft.missing, IsEmpty());
  EXPECT_THAT(draft.chosen, Contains(HasSubstr("GREY 640x400 at 30 Hz")));
}

TEST(Draft, OnlyWhatIsPlausibleAloneIsChosen) {
  Parts parts;
  parts.cameras = {camera("/dev/video0", {kYuyv640})};
  parts.serial = {port("/dev/ttyAMA0", ""), port("/dev/ttyAMA1", "")};
  parts.can.resize(2);
  parts.can[0].path = "can0";
  parts.can[1].path = "can1";
  const Config unclear = config_of(draft_of(parts));
  EXPECT_EQ(unclear.devices.mavlink.serial, "");
  EXPECT_EQ(unclear.devices.can.interface, "");
  parts.serial.clear();
  parts.can.pop_back();
  const Config bus = config_of(draft_of(parts));
  EXPECT_EQ(bus.devices.can.interface, "can0");
  EXPECT_FALSE(bus.devices.can.fd) << "the interface has none";
}

TEST(Draft, TheControllersImuIsTakenIfThereIsNoOther) {
  Parts parts;
  parts.cameras = {camera("/dev/video0", {kYuyv640})};
  parts.serial = {port("/dev/ttyACM0", "PX4 flight controller")};
  EXPECT_EQ(config_of(draft_of(parts)).devices.imu.driver, static_cast<int>(ImuDriver::kMavlink));
  parts.spi.resize(1);
  EXPECT_EQ(config_of(draft_of(parts)).devices.imu.driver, static_cast<int>(ImuDriver::kIio))
      << "unclear: the default, and a comment";
  parts.imus = {imu("/dev/iio:device0", "adis16475", true, true)};
  EXPECT_EQ(config_of(draft_of(parts)).devices.imu.device, "adis16475");
}

TEST(Draft, AGyroscopeAloneIsNoImu) {
  Parts parts;
  parts.imus = {imu("/dev/iio:device0", "gyro", true, false)};
  const Draft draft = draft_of(parts);
  EXPECT_EQ(config_of(draft).devices.imu.device, "");
  EXPECT_THAT(draft.missing, Contains(HasSubstr("imu")));
}

TEST(Draft, NamesThatWouldBreakTheFileDoNot) {
  Parts parts;
  parts.cameras = {camera("/dev/video0", {kYuyv640})};
  parts.cameras[0].name = parts.cameras[0].settings[0].value = "Cam\n[mavlink]\nserial = \"x\"\xff";
  parts.imus = {imu("/dev/iio:device0", "a\"quoted\\name", true, true)};
  const Config config = config_of(draft_of(parts));
  EXPECT_EQ(config.devices.camera.device, "/dev/video0");
  EXPECT_EQ(config.devices.imu.device, "a\"quoted\\name");
  EXPECT_EQ(config.devices.mavlink.serial, "");
}

TEST(Draft, ReplacesAFileOnlyWhenAskedAndKeepsIt) {
  const fs::path folder = fs::path(testing::TempDir()) / ("epiline-draft-" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const fs::path file = folder / "flight.toml", kept = folder / "flight.toml.bak";
  const Draft draft{"[camera]\nwidth = 640\n", {}, {}};
  const auto text_of = [](const fs::path& path) { return *read_text(path); };
  ASSERT_TRUE(write_text(file, "# mine\n"));
  const Status refused = write_draft(draft, file, false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_THAT(refused.error().text(), HasSubstr("flight.toml: exists already; expected another name"));
  EXPECT_EQ(text_of(file), "# mine\n");
  EXPECT_FALSE(fs::exists(kept));
  EXPECT_TRUE(write_draft(draft, file, true));
  EXPECT_EQ(text_of(file), draft.toml);
  EXPECT_EQ(text_of(kept), "# mine\n");
  fs::remove(file);
  EXPECT_TRUE(write_draft(draft, file, false));
  EXPECT_FALSE(write_draft(draft, folder / "none" / "flight.toml", false));
  fs::remove_all(folder);
}

TEST(CameraMode, WeighsRateFormatAndSize) {
  const auto mode_of = [](std::vector<CameraFormat> formats) {
    static std::vector<CameraPart> cameras;
    cameras = {camera("/dev/video0", std::move(formats))};
    const auto mode = choose_mode(cameras);
    return mode ? mode->format->name + " " + std::to_string(mode->width) + "x" + std::to_string(mode->height) + " " +
                      std::to_string(std::lround(mode->rate_hz))
                : "none";
  };
  EXPECT_EQ(mode_of({kH264}), "none");
  EXPECT_EQ(mode_of({kMjpeg}), "MJPG 1280x720 60");
  EXPECT_EQ(mode_of({kMjpeg, {"YUYV", true, false, {size(1280, 720, {10})}}}), "MJPG 1280x720 60") << "in time first";
  EXPECT_EQ(mode_of({kMjpeg, {"RGGB", true, true, {size(1456, 1088, {60})}}}), "RGGB 1456x1088 60") << "not decoded";
  EXPECT_EQ(mode_of({kYuyv640, kMjpeg}), "YUYV 640x480 30") << "not 10 Hz";
  EXPECT_EQ(mode_of({kYuyv640, {"Y10", true, false, {size(1280, 800, {25})}}}), "Y10 1280x800 25") << "grey first";
  EXPECT_EQ(mode_of({kYuyv640, {"GREY", true, false, {size(640, 480, {7.5})}}}), "YUYV 640x480 30") << "in time first";
  EXPECT_EQ(mode_of({{"GREY", true, false, {size(320, 240, {30}), size(1280, 720, {60}), size(1920, 1080, {30})}}}),
            "GREY 1280x720 60");
  EXPECT_EQ(mode_of({{"GREY", true, false, {{16, 16, 4056, 3040, {1, 120}, true}}}}), "GREY 640x480 30");
  EXPECT_EQ(mode_of({{"GREY", true, false, {size(640, 480, {})}}}), "GREY 640x480 0");
}

}  // namespace
}  // namespace epiline
