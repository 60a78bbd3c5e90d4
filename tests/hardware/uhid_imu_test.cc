// The virtual IMU against what the kernel makes of it, read with nothing but files.
#include "drivers/program/hil/uhid_imu.h"

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/hardware/support.h"

namespace epiline {
namespace {

TEST(UhidImu, ReadingsAndTimesComeOutOfIioAsTheyWentIn) {
  UhidImu imu;
  const Status status = imu.plug_in();
  ASSERT_TRUE(status) << status.error().text();
  const std::array devices{imu.gyroscope_device(), imu.accelerometer_device()};
  const std::array names{"gyro_3d", "accel_3d"}, types{"anglvel", "accel"};
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string sys = "/sys/bus/iio/devices/" + devices[i];
    EXPECT_EQ(first_line(sys + "/name"), names[i]);
    EXPECT_EQ(std::stod(first_line(sys + "/in_" + types[i] + "_scale")), 1e-6);
    for (const char* axis : {"x", "y", "z"}) {
      const std::string channel = sys + "/scan_elements/in_" + types[i] + "_" + axis;
      EXPECT_EQ(first_line(channel + "_type"), "le:s32/32>>0");
      write_file(channel + "_en", "1");
    }
    write_file(sys + "/scan_elements/in_timestamp_en", "1");
    write_file(sys + "/in_" + types[i] + "_sampling_frequency", "200");
    EXPECT_FALSE(imu.is_on());
    write_file(sys + "/buffer/enable", "1");
  }
  EXPECT_TRUE(imu.is_on());
  EXPECT_EQ(imu.interval_ms(), 5);
  const std::int64_t time_ns = 1'403'636'579'758'555'393;
  EXPECT_TRUE(imu.send_gyroscope({time_ns}, {0.1, -0.2, 3e-6}));
  EXPECT_TRUE(imu.send_accelerometer({time_ns + 1}, {-9.81, 0, 1e6}));
  const std::int32_t expected[2][3] = {{100'000, -200'000, 3}, {-9'810'000, 0, 2'147'483'647}};
  for (std::size_t i = 0; i < 2; ++i) {
    std::ifstream device("/dev/" + devices[i], std::ios::binary);
    char scan[24];
    ASSERT_TRUE(device.read(scan, sizeof(scan)));
    std::int32_t axes[3];
    std::int64_t stamp_ns = 0;
    std::memcpy(axes, scan, sizeof(axes));
    std::memcpy(&stamp_ns, scan + 16, sizeof(stamp_ns));
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(axes[axis], expected[i][axis]) << names[i] << axis;
    EXPECT_EQ(stamp_ns, time_ns + static_cast<std::int64_t>(i));
  }
  imu.unplug();
  EXPECT_TRUE(within(10, [&] { return !std::filesystem::exists("/dev/" + devices[0]); }));
  EXPECT_FALSE(imu.send_gyroscope({1}, {}));
  EXPECT_TRUE(imu.plug_in()) << "once more";
}

}  // namespace
}  // namespace epiline
