// What the kernel's HID sensors do not have: big-endian scans, offsets, mount matrices, both sensors in one device,
// rates that are refused. On a folder that looks like sysfs; tests/hardware has the kernel itself.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/drivers/sensors/imu/fake_sysfs.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using test::FakeSysfs;

TEST_F(FakeSysfs, ValuesAreCountPlusOffsetTimesScaleInTheBoardsAxes) {
  IioDevice device;
  const DeviceTrouble trouble = device.open(roots(), request_);
  ASSERT_FALSE(trouble) << error_of(trouble, "it").text();
  EXPECT_EQ(device.rate_hz(), 200);
  EXPECT_EQ(get("buffer/enable"), "1");
  EXPECT_EQ(get("buffer/length"), "100");
  EXPECT_EQ(get("current_timestamp_clock"), "monotonic");
  EXPECT_EQ(get("scan_elements/in_temp0_en"), "0") << "nobody wants it";
  std::array<IioReading, 8> readings;
  std::size_t count = 1;
  const int writer = ::open((root_ + "/dev/iio:device3").c_str(), O_WRONLY | O_NONBLOCK);
  ASSERT_GE(writer, 0);
  EXPECT_EQ(device.read(readings, count), EAGAIN);
  EXPECT_EQ(count, 0u);
  // gyroscope 1000, 0x801 -> 2049 - 2048, -1; accelerometer 1, 2, 3; padding; time
  const std::vector<std::uint8_t> scan{0x03, 0xE8, 0x80, 0x1F, 0xFF, 0xFF, 0,    1,    0, 2, 0, 3,
                                       9,    9,    9,    9,    0x00, 0xCA, 0x9A, 0x3B, 0, 0, 0, 0};
  ASSERT_EQ(::write(writer, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  ASSERT_EQ(::write(writer, scan.data(), scan.size()), static_cast<ssize_t>(scan.size()));
  ASSERT_EQ(device.read(readings, count), 0);
  ASSERT_EQ(count, 2u);
  EXPECT_EQ(readings[1].stamp_ns, 1'000'000'000);
  EXPECT_EQ(readings[1].angular_velocity_rad_s, (std::array<double, 3>{1.0, 0.001, -0.001}));
  EXPECT_EQ(readings[1].specific_force_m_s2, (std::array<double, 3>{0.004, -0.001, 0.003}));
  ASSERT_EQ(::write(writer, scan.data(), 7), 7) << "no kernel does that";
  EXPECT_EQ(device.read(readings, count), EPROTO);
  ::close(writer);
  device.close();
  EXPECT_EQ(get("buffer/enable"), "0");
  EXPECT_EQ(get("buffer/length"), "2");
  EXPECT_EQ(get("scan_elements/in_temp0_en"), "1");
  EXPECT_EQ(get("scan_elements/in_accel_x_en"), "0");
  EXPECT_EQ(get("current_timestamp_clock"), "realtime");
}

TEST_F(FakeSysfs, OnlyTheSensorAskedForIsSwitchedOn) {
  IioRequest request = request_;
  request.accelerometer = false;
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("scan_elements/in_anglvel_z_en"), "1");
  EXPECT_EQ(get("scan_elements/in_accel_z_en"), "0");
}

TEST_F(FakeSysfs, FastSensorsWakeUsForSeveralReadings) {
  put("sampling_frequency", "2000.000000\n");
  IioRequest request = request_;
  request.rate_hz = 2'000;
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("buffer/watermark"), "4");
  EXPECT_EQ(get("buffer/length"), "1000");
  put("buffer/hwfifo_watermark_min", "8\n");
  device.close();
  ASSERT_FALSE(device.open(roots(), request));
  EXPECT_EQ(get("buffer/watermark"), "8");
}

TEST_F(FakeSysfs, TheRateIsSetWhereItIs) {
  fs::remove(device_ + "/sampling_frequency");
  put("in_anglvel_sampling_frequency", "100\n");
  put("in_accel_sampling_frequency", "50\n");
  IioDevice device;
  ASSERT_FALSE(device.open(roots(), request_));
  EXPECT_EQ(get("in_anglvel_sampling_frequency"), "200");
  EXPECT_EQ(get("in_accel_sampling_frequency"), "200");
  device.close();
  fs::remove(device_ + "/in_anglvel_sampling_frequency");
  fs::remove(device_ + "/in_accel_sampling_frequency");
  fs::create_directories(device_ + "/trigger");
  fs::create_directories(root_names_[0] + "/trigger0");
  put("trigger/current_trigger", "\n");
  put("../trigger0/name", "adis16470-dev3\n");
  put("../trigger0/sampling_frequency", "100\n");
  ASSERT_FALSE(device.open(roots(), request_));
  EXPECT_EQ(get("trigger/current_trigger"), "adis16470-dev3");
  EXPECT_EQ(get("../trigger0/sampling_frequency"), "200");
  device.close();
  EXPECT_EQ(get("../trigger0/sampling_frequency"), "100");
}

TEST_F(FakeSysfs, SaysWhatIsWrong) {
  IioRequest request = request_;
  request.device = "bmi160";
  EXPECT_EQ(trouble_of(request), "it: no IIO device is called 'bmi160' [open]; expected one of adis16470");
  put("scan_elements/in_accel_y_type", "le:s16/16\n");
  EXPECT_EQ(trouble_of(request_), "it: in_accel_y_en: le:s16/16 [layout of a scan]; expected a type like le:s16/16>>0");
  put("scan_elements/in_accel_y_type", "be:s16/16>>0\n");
  put("in_accel_mount_matrix", "1, 0, 0; 0, 1, 0; 0, 0, 0\n");
  EXPECT_EQ(
      trouble_of(request_),
      "it: in_accel_mount_matrix: 1, 0, 0; 0, 1, 0; 0, 0, 0 [mount matrix]; expected a rotation: 1, 0, 0; 0, 1, 0; "
      "0, 0, 1");
  fs::remove(device_ + "/in_accel_mount_matrix");
  put("in_anglvel_scale", "nan\n");
  EXPECT_EQ(trouble_of(request_), "it: in_anglvel_scale has no number [scale]; expected a number");
  fs::remove(device_ + "/scan_elements/in_anglvel_x_en");
  EXPECT_EQ(trouble_of(request_), "it: adis16470 has no gyroscope [channels]; expected a gyroscope in imu.device");
  fs::create_directories(root_names_[0] + "/iio:device11");
  put("../iio:device11/name", "adis16470\n");
  EXPECT_NE(trouble_of(request_).find("2 devices are called 'adis16470' [open]; expected iio:device"),
            std::string::npos);
  EXPECT_EQ(get("buffer/enable"), "0");
}

TEST_F(FakeSysfs, APathNamesTheDeviceToo) {
  fs::create_symlink(root_ + "/dev/iio:device3", root_ + "/dev/imu");
  IioRequest request = request_;
  const std::string link = root_ + "/dev/imu", missing = root_ + "/dev/missing", other = root_ + "/dev/sound";
  request.device = link.c_str();
  EXPECT_EQ(trouble_of(request), "opened");
  request.device = missing.c_str();
  EXPECT_EQ(trouble_of(request).rfind("it: No such file or directory [open]; expected ", 0), 0u) << trouble_of(request);
  std::ofstream(other) << "";
  request.device = other.c_str();
  EXPECT_EQ(trouble_of(request), "it: " + other + " is not an IIO device [open]; expected an IIO device");
}

TEST_F(FakeSysfs, SaysWhatIsMissing) {
  IioRequest request = request_;
  request.trigger = "sync";
  EXPECT_EQ(trouble_of(request), "it: adis16470 has no trigger [trigger]; expected imu.trigger not to be set");
  fs::create_directories(device_ + "/trigger");
  put("trigger/current_trigger", "\n");
  fs::create_directories(root_names_[0] + "/trigger0");
  put("../trigger0/name", "adis16470-dev3\n");
  EXPECT_EQ(trouble_of(request), "it: no trigger is called 'sync' [trigger]; expected one of adis16470-dev3");
  fs::remove(device_ + "/scan_elements/in_timestamp_en");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [scan_elements/in_timestamp_en]", 0), 0u);
  put("scan_elements/in_timestamp_en", "0\n");
  fs::remove(device_ + "/buffer/length");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [buffer/length]", 0), 0u);
  fs::remove(root_ + "/dev/iio:device3");
  EXPECT_EQ(trouble_of(request_).rfind("it: No such file or directory [open]", 0), 0u);
  fs::remove_all(root_names_[0]);
  EXPECT_EQ(trouble_of(request_), "it: there are no IIO devices [open]; expected an IMU whose kernel driver is loaded");
  fs::create_directories(root_names_[0]);
  EXPECT_EQ(trouble_of(request_),
            "it: no IIO device is called 'adis16470' [open]; expected an IMU whose kernel driver is loaded");
}

TEST(IioMountMatrix, IsARotationOrNothing) {
  std::array<double, 9> m{};
  EXPECT_TRUE(parse_mount_matrix("1, 0, 0; 0, 1, 0; 0, 0, 1", m));
  EXPECT_TRUE(parse_mount_matrix("0.707, 0.707, 0; -0.707, 0.707, 0; 0, 0, 1", m));
  EXPECT_EQ(m[3], -0.707);
  for (const char* wrong : {"", "1", "1, 0, 0; 0, 1, 0; 0, 0", "1, 0, 0; 0, 1, 0; 0, 0, 1;", "1 0 0 0 1 0 0 0 1",
                            "1, 0, 0; 0, 1, 0; 0, 1, 0", "inf, 0, 0; 0, 1, 0; 0, 0, 1", "nan, 0, 0; 0, 1, 0; 0, 0, 1"})
    EXPECT_FALSE(parse_mount_matrix(wrong, m)) << wrong;
}

}  // namespace
}  // namespace epiline
