#include "drivers/program/live/devices.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/links/can/can_output.h"
#include "drivers/links/mavlink/link.h"
#include "drivers/sensors/camera/camera_pair.h"
#include "drivers/sensors/camera/side_by_side.h"
#include "drivers/sensors/camera/v4l2_camera.h"
#include "drivers/sensors/imu/iio_imu.h"
#include "drivers/sensors/imu/spi_imu.h"
#include "drivers/sensors/wheel/can_wheel_source.h"
#include "tests/drivers/program/must.h"

namespace epiline {
namespace {

using test::must;
using testing::HasSubstr;
using testing::StartsWith;

/// A configuration file beside calibration files.
class Files {
 public:
  Files() : folder_(std::filesystem::path(testing::TempDir()) / ("devices_" + std::to_string(getpid()))) {
    std::filesystem::create_directories(folder_);
    write("camera.yaml",
          "T_BS:\n  data: [1, 0, 0, 0.1, 0, 1, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\nresolution: [640, 480]\n"
          "camera_model: pinhole\nintrinsics: [400, 400, 320, 240]\ndistortion_model: none\n"
          "distortion_coefficients: []\ntimeshift_cam_imu: 0.004\n");
    write("imu.yaml",
          "gyroscope_noise_density: 1.0e-03\ngyroscope_random_walk: 1.0e-05\naccelerometer_noise_density: 1.0e-2\n"
          "accelerometer_random_walk: 1.0e-4\n");
  }
  ~Files() { std::filesystem::remove_all(folder_); }
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string config(const std::string& camera, const std::string& more) const {
    return write("flight.toml",
                 "[camera]\ncalibration = \"" + (folder_ / "camera.yaml").string() + "\"\n" + camera + more);
  }
  std::string folder() const { return folder_.string(); }

 private:
  std::filesystem::path folder_;
};

/// Of the settings, or of the devices that are made of them.
std::string error_of(const Result<LiveSettings>& settings) {
  if (!settings) return settings.error().text();
  const auto devices = make_devices(*settings);
  return devices ? "" : devices.error().text();
}

TEST(Devices, SettingsAreTheFileOverCalibrationOverDefaults) {
  const Files files;
  const auto settings = must(read_live_settings(
      files.config("", "[imu]\ncalibration = \"" + files.folder() + "/imu.yaml\"\ngyroscope_random_walk = 3e-5\n")));
  EXPECT_EQ(settings.camera.width, 640);
  const EstimatorConfig& e = settings.config.estimator;
  EXPECT_DOUBLE_EQ(e.extrinsics.p_BC.x(), 0.1);
  EXPECT_DOUBLE_EQ(e.extrinsics.time_offset_s, 0.004);
  EXPECT_NEAR(e.extrinsics.focal_px, 400, 1);
  EXPECT_DOUBLE_EQ(e.imu.gyroscope_density, 1e-3);
  EXPECT_DOUBLE_EQ(e.imu.gyroscope_random_walk, 3e-5);
}

TEST(Devices, WhatIsMissingIsNamedWithWhatWouldDo) {
  const Files files;
  const std::string file = files.folder() + "/flight.toml: ",
                    port = "expected its port in mavlink.serial or mavlink.udp";
  const char *const device = "device = \"a\"\n", *const imu = "[imu]\ndevice = \"b\"\n",
                    *const imu_of_controller = "[imu]\ndriver = \"mavlink\"\n";
  const auto expect_error = [&](const std::string& camera, const std::string& more, const std::string& error) {
    EXPECT_THAT(error_of(read_live_settings(files.config(camera, more))), StartsWith(file + error));
  };
  expect_error("", "",
               "camera.device is not set; expected the camera's path, name or bus (epiline devices lists cameras)");
  expect_error(device, "", "imu.device is not set; expected the IMU's name or path, or imu.driver = \"mavlink\"");
  expect_error(device, std::string(imu) + "[height]\nsource = \"mavlink\"\n",
               "height.source = \"mavlink\" without a flight controller; " + port);
  expect_error("device = \"a\"\nwidth = 320\n", imu,
               "camera.width = 320, camera.height = 480; expected 640 x 480, the image size in camera.calibration");
  expect_error("device = \"a\"\nformat = \"H264\"\n", imu, "camera.format: \"H264\"; expected GREY, Y10, Y12, ");
  expect_error(device, imu_of_controller, "imu.driver = \"mavlink\" without a flight controller; " + port);
  expect_error(device,
               std::string(imu_of_controller) +
                   "[mavlink]\nudp = \"127.0.0.1:14550\"\n[body]\nyaw_pitch_roll_deg = [90, 0, 0]\n",
               "angles in [body] with imu.driver = \"mavlink\"; expected angles of 0: a flight controller sends its "
               "samples in the vehicle's axes");
  EXPECT_THAT(error_of(read_live_settings(files.write("none.toml", "[camera]\ndevice = \"a\"\n"))),
              StartsWith(files.folder() + "/none.toml: camera.calibration is not set; expected"));
}

TEST(Devices, EveryDriverOfAnImuIsAtHand) {
  const Files files;
  for (const char* const driver : {"iio", "icm42688p", "bmi088", "adis16470", "mavlink"}) {
    const auto settings = must(read_live_settings(
        files.config("device = \"a\"\n", std::string("[imu]\ndevice = \"b\"\ndevice_accel = \"c\"\ndriver = \"") +
                                             driver + "\"\n[mavlink]\nudp = \"127.0.0.1:14550\"\n")));
    const auto devices = must(make_devices(settings));
    EXPECT_NE(devices.imu, nullptr);
    EXPECT_EQ(devices.outputs.size(), 1u);
    EXPECT_EQ(devices.records.size(), 3u) << "camera, IMU, flight controller";
    for (const auto& record : devices.records) EXPECT_FALSE(record().counts.empty());
  }
}

TEST(Devices, OdometryForRos2ComesFromTheLogThread) {
  const Files files;
  const std::string sensors = "[camera]\ndevice = \"a\"\n[imu]\ndevice = \"b\"\n";
  const auto outputs_of = [&](const std::string& dds) {
    return make_each_device(
               must(read_live_settings(files.write("dds.toml", sensors + dds), {}, CalibrationNeed::kIfGiven)))
        .devices.outputs;
  };
  EXPECT_TRUE(outputs_of("").empty());
  const auto outputs = outputs_of("[dds]\npublish = true\n");
  ASSERT_EQ(outputs.size(), 1u);
  EXPECT_EQ(outputs[0].name, "dds");
  EXPECT_NE(outputs[0].observer, nullptr);
}

TEST(Devices, ARecordingNeedsNoCalibrationAndNoReceiver) {
  const Files files;
  const std::string can = "[can]\ninterface = \"can0\"\n[mavlink]\nudp = \"127.0.0.1:14550\"\n";
  const auto sensors_of = [&](const std::string& imu) {
    return read_live_settings(files.write("plain.toml", "[camera]\ndevice = \"a\"\n" + imu + can), {},
                              CalibrationNeed::kIfGiven);
  };
  const auto iio = must(sensors_of("[imu]\ndevice = \"b\"\n"));
  EXPECT_FALSE(iio.has_camera_calibration());
  const auto devices = must(make_sensors(iio));
  EXPECT_NE(devices.camera, nullptr);
  EXPECT_NE(devices.imu, nullptr);
  EXPECT_TRUE(devices.outputs.empty());
  const auto over_link = must(sensors_of("[imu]\ndriver = \"mavlink\"\n"));
  const auto with_link = must(make_sensors(over_link));
  ASSERT_EQ(with_link.outputs.size(), 1u) << "the samples come over it";
  EXPECT_EQ(with_link.outputs[0].name, "mavlink 127.0.0.1:14550");

  const auto wrong = read_live_settings(files.write("wrong.toml", "[camera]\ncalibration = \"none.yaml\"\n"), {},
                                        CalibrationNeed::kIfGiven);
  EXPECT_FALSE(wrong) << "one that is named must be there";
}

template <class Counters>
void expect_told_in(const char* page, const Counters& counters) {
  std::ifstream file(std::string(EPILINE_SOURCE "/docs/") + page);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  for (const auto& c : counters) {
    const std::string name = std::string("`").append(c.name).append("`");
    EXPECT_NE(text.find(name), std::string::npos) << page << " does not explain " << name;
  }
}

TEST(Devices, WhatTheyCountIsExplainedInTheirPages) {
  expect_told_in("camera.md", kCameraCounters);
  expect_told_in("imu.md", kIioCounters);
  expect_told_in("imu.md", kSpiImuCounters);
  expect_told_in("flight-controller.md", mavlink::kLinkCounters);
  expect_told_in("flight-controller.md", mavlink::kControllerImuCounters);
  expect_told_in("can.md", kCanCounters);
  expect_told_in("can.md", kWheelCounters);
}

TEST(Devices, AMaskLiesBesideTheFileThatNamesIt) {
  const Files files;
  const auto with_mask = [&](int width) {
    const std::vector<std::uint8_t> white(static_cast<std::size_t>(width) * 480, 255);
    files.write("mask.png", png_of({white.data(), width, 480, width}));
    return read_live_settings(files.config("mask = \"mask.png\"\n", ""));
  };
  const auto settings = must(with_mask(640));
  EXPECT_NE(settings.config.tracker.masks[0], nullptr);
  const auto wrong = with_mask(600);
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().text(), files.folder() +
                                      "/mask.png: 600 x 480; expected 640 x 480, the size of the camera's "
                                      "images (camera.mask)");
}

// ---- two cameras ----

constexpr const char* kChain =
    "cam0:\n  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n  camera_model: pinhole\n"
    "  distortion_coeffs: [0, 0, 0, 0]\n  distortion_model: radtan\n  intrinsics: [400, 400, 320, 240]\n"
    "  resolution: [640, 480]\n  timeshift_cam_imu: 0.004\n"
    "cam1:\n  T_cam_imu: [[1, 0, 0, -0.1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n  camera_model: pinhole\n"
    "  distortion_coeffs: [0, 0, 0, 0]\n  distortion_model: radtan\n  intrinsics: [410, 410, 320, 240]\n"
    "  resolution: [640, 480]\n  timeshift_cam_imu: 0.006\n";
const std::string kSecond = "[second_camera]\ndevice = \"/dev/video1\"\n";
constexpr const char* kImu = "[imu]\ndevice = \"bmi088\"\n";

class TwoCameras : public testing::Test {
 protected:
  Result<LiveSettings> read(const std::string& camera, const std::string& more = "",
                            const std::string& chain = kChain) const {
    const std::string file = files_.write("chain.yaml", chain).string();
    return read_live_settings(files_.write(
        "two.toml", "[camera]\ncalibration = \"" + file + "\"\ndevice = \"/dev/video0\"\n" + camera + kImu + more));
  }
  std::string error(const std::string& camera, const std::string& more = "", const std::string& chain = kChain) const {
    return error_of(read(camera, more, chain));
  }
  std::vector<std::string> names(const LiveDevices& devices) const {
    std::vector<std::string> all;
    for (const auto& record : devices.records) all.push_back(record().name);
    return all;
  }
  Files files_;
};

TEST_F(TwoCameras, OfTwoDevicesAreAPair) {
  const auto settings = must(read("", kSecond));
  ASSERT_TRUE(settings.others[0]);
  EXPECT_DOUBLE_EQ(settings.others[0]->parameters.intrinsics[0], 410);
  EXPECT_TRUE(settings.config.estimator.others[0].use);
  EXPECT_DOUBLE_EQ(settings.config.estimator.others[0].p_BC.x(), 0.1);
  const auto devices = must(make_devices(settings));
  EXPECT_NE(dynamic_cast<const CameraPair*>(devices.camera.get()), nullptr);
  EXPECT_EQ(names(devices), (std::vector<std::string>{"camera", "second camera", "second camera paired", "imu"}));
}

TEST_F(TwoCameras, ThatRunFreelyAreNearestWithinHalfAPeriod) {
  const auto apart_s = [&](const std::string& camera, const std::string& second) {
    return must(read(camera, kSecond + second)).config.estimator.others[0].apart_s;
  };
  EXPECT_EQ(apart_s("", ""), 0) << "triggered together";
  EXPECT_EQ(apart_s("", "within_ms = 5\n"), 0);
  EXPECT_DOUBLE_EQ(apart_s("rate_hz = 20\n", "free_running = true\n"), 0.025);
  EXPECT_DOUBLE_EQ(apart_s("", "free_running = true\n"), 0.5 / 30) << "of a usual camera";
  EXPECT_DOUBLE_EQ(apart_s("rate_hz = 20\n", "free_running = true\nwithin_ms = 10\n"), 0.01);
}

TEST_F(TwoCameras, MayHaveRollingShutters) {
  const auto settings = must(read("shutter = \"rolling\"\nreadout_ms = 15\n", kSecond));
  EXPECT_DOUBLE_EQ(settings.others[0]->parameters.readout_s, 0.015);
  EXPECT_DOUBLE_EQ(settings.config.estimator.others[0].readout_s, 0.015);
}

TEST_F(TwoCameras, SideBySideAreHalvesOfOneDevice) {
  const auto settings = must(read("side_by_side = \"left-first\"\n"));
  EXPECT_TRUE(settings.others[0]);
  const auto devices = must(make_devices(settings));
  EXPECT_NE(dynamic_cast<const SideBySide*>(devices.camera.get()), nullptr);
  EXPECT_NE(devices.v4l2, nullptr);
}

/// The chain with more cameras, which are like cam1.
std::string chain_of_four() {
  std::string chain(kChain);
  const std::string second = chain.substr(chain.find("cam1:"));
  for (const char* name : {"cam2", "cam3"}) chain += name + second.substr(4);
  return chain;
}

TEST_F(TwoCameras, OrUpToFour) {
  const std::string more = "[third_camera]\ndevice = \"/dev/video2\"\nfree_running = true\n";
  const std::string four = kSecond + more + "[fourth_camera]\ndevice = \"/dev/video3\"\n";
  const auto settings = must(read("rate_hz = 20\n", four, chain_of_four()));
  for (const auto& camera : settings.others) EXPECT_TRUE(camera);
  EXPECT_EQ(settings.config.estimator.others[0].apart_s, 0);
  EXPECT_DOUBLE_EQ(settings.config.estimator.others[1].apart_s, 0.025);
  const auto devices = must(make_devices(settings));
  EXPECT_EQ(names(devices),
            (std::vector<std::string>{"camera", "second camera", "second camera paired", "third camera",
                                      "third camera paired", "fourth camera", "fourth camera paired", "imu"}));
  const auto board = must(read("side_by_side = \"left-first\"\n", more, chain_of_four()));
  EXPECT_TRUE(board.others[1]) << "behind both of a stereo board";
  EXPECT_FALSE(board.others[2]);
}

TEST_F(TwoCameras, WhatDoesNotGoTogetherIsRefused) {
  EXPECT_THAT(
      error("side_by_side = \"left-first\"\nwidth = 640\n"),
      HasSubstr("camera.width = 640, camera.height = 480; expected 1280 x 480, twice the width of the image size "
                "in camera.calibration"));
  EXPECT_THAT(error("side_by_side = \"left-first\"\n", kSecond),
              HasSubstr("camera.side_by_side and second_camera.device; expected one of them"));
  const std::string chain(kChain);
  EXPECT_THAT(error("", kSecond, chain.substr(0, chain.find("cam1:"))),
              HasSubstr("second_camera.calibration is not set, and camera.calibration has no cam1"));
  std::string other = chain;
  other.replace(other.rfind("[640, 480]"), 10, "[320, 240]");
  EXPECT_THAT(error("", kSecond, other),
              HasSubstr("a second camera of 320 x 240; expected 640 x 480, as the first one"));
  EXPECT_THAT(error("", kSecond + "[fourth_camera]\ndevice = \"/dev/video3\"\n"),
              HasSubstr("a fourth camera, but no third camera; expected third_camera.device"));
  EXPECT_THAT(error("", kSecond + "[third_camera]\ndevice = \"/dev/video2\"\n"),
              HasSubstr("third_camera.calibration is not set, and camera.calibration has no cam2"));
}

}  // namespace
}  // namespace epiline
