#pragma once
// A folder that looks like sysfs, with an IIO device that has both sensors.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/sensors/imu/iio_device.h"

namespace epiline::test {

/// A device with both sensors: 16 bits, big-endian, y of the gyroscope shifted.
class FakeSysfs : public testing::Test {
 protected:
  FakeSysfs() {
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(device_ + "/buffer");
    std::filesystem::create_directories(device_ + "/scan_elements");
    std::filesystem::create_directories(root_ + "/dev");
    EXPECT_EQ(::mkfifo((root_ + "/dev/iio:device3").c_str(), 0600), 0);
    put("name", "adis16470\n");
    put("sampling_frequency", "200.000000\n");
    put("current_timestamp_clock", "realtime\n");
    put("buffer/enable", "0\n"), put("buffer/length", "2\n"), put("buffer/watermark", "1\n");
    int index = 0;
    for (const char* type : {"anglvel", "accel"}) {
      put("in_" + std::string(type) + "_scale", "0.001\n");
      for (const char* axis : {"x", "y", "z"}) element("in_" + std::string(type) + "_" + axis, index++, "be:s16/16>>0");
    }
    put("scan_elements/in_anglvel_y_type", "be:u12/16>>4\n");
    put("in_anglvel_y_offset", "-2048\n");
    put("in_accel_y_scale", "0.002\n");
    put("in_accel_mount_matrix", "0, 1, 0; -1, 0, 0; 0, 0, 1\n");
    element("in_temp0", 6, "be:s16/16>>0");
    put("scan_elements/in_temp0_en", "1\n");
    element("in_timestamp", 7, "le:s64/64>>0");
  }
  ~FakeSysfs() override { std::filesystem::remove_all(root_); }

  void put(const std::string& name, const std::string& text) { std::ofstream(device_ + "/" + name) << text; }
  void element(const std::string& name, int index, const std::string& type) {
    put("scan_elements/" + name + "_en", "0\n");
    put("scan_elements/" + name + "_index", std::to_string(index) + "\n");
    put("scan_elements/" + name + "_type", type + "\n");
  }
  std::string get(const std::string& name) {
    std::string line;
    std::ifstream file(device_ + "/" + name);
    std::getline(file, line);
    return line;
  }
  std::string trouble_of(const IioRequest& request) {
    IioDevice device;
    const DeviceTrouble trouble = device.open(roots(), request);
    return trouble ? error_of(trouble, "it").text() : "opened";
  }
  IioRoots roots() const { return {root_names_[0].c_str(), root_names_[1].c_str()}; }

  const std::string root_ = testing::TempDir() + "iio-" + std::to_string(::getpid());
  const std::string device_ = root_ + "/sys/iio:device3";
  const std::array<std::string, 2> root_names_{root_ + "/sys", root_ + "/dev"};
  const IioRequest request_{"adis16470", true, true, 200, ""};
};

}  // namespace epiline::test
