// `epiline run` as a user meets it where something is missing. Whole flights of it: tests/hardware.
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "tests/drivers/program/program.h"

namespace epiline {
namespace {

constexpr const char* kCalibration =
    "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nresolution: [640, 480]\ncamera_model: pinhole\n"
    "intrinsics: [400, 400, 320, 240]\ndistortion_model: none\n";

class RunCommand : public CommandTest {
 protected:
  /// With this configuration; `camera`: keys of its section besides the calibration.
  static Outcome run_with(const std::string& camera, const std::string& rest = "", const std::string& options = "") {
    write(scratch() / "camera.yaml", kCalibration);
    const std::string calibration = "[camera]\ncalibration = \"" + (scratch() / "camera.yaml").string() + "\"\n";
    return run("run" + with_config(calibration + camera + rest) + options);
  }
  /// With devices that are not there.
  static Outcome run_without_devices(const std::string& options) {
    return run_with("device = \"/dev/video77\"\n", "[imu]\ndevice = \"/sys/bus/iio/devices/iio:device77\"\n", options);
  }
};

// More of that: live/devices_test.cc.
TEST_F(RunCommand, SaysWhatTheConfigurationLacks) {
  expect_one_line(run("run --config /does/not/exist.toml"), 2, {"/does/not/exist.toml"});
  expect_one_line(run_with(""), 2, {"flight.toml: camera.device is not set"});
  expect_one_line(run_with("", "[camera]\n"), 2, {"flight.toml:"});
  expect_one_line(run_with("device = \"/dev/video77\"\n", "", "--set imu.device=a --set imu.drver=iio"), 2,
                  {"--set imu.drver=iio", "expected \"imu.driver\""});
  expect_one_line(run_with("divice = \"/dev/video77\"\n"), 2, {"flight.toml:3: ", "camera.divice"});
}

TEST_F(RunCommand, SaysWhichDeviceIsNotThere) {
  const Outcome r = run_without_devices("--quiet --duration 1");
  expect_one_line(r, 1, {"iio:device77"});
  EXPECT_TRUE(r.out.empty()) << r.out;
}

// It may be plugged in at any time: until then it is said what is missing, and any signal ends that.
TEST_F(RunCommand, WaitsForADeviceAndSaysSo) {
  const Outcome waits = run_without_devices("--duration 2");
  EXPECT_EQ(waits.exit_code, 1);
  EXPECT_NE(waits.out.find("s  waiting for IMU: "), std::string::npos) << waits.out;
  EXPECT_NE(waits.out.find("iio:device77"), std::string::npos) << waits.out;
  const Outcome ends = run_without_devices("--no-wait");
  expect_one_line(ends, 1, {"iio:device77"});
  EXPECT_EQ(ends.out.find("waiting"), std::string::npos) << ends.out;
}

// stdout on a full disk: the run goes on to its end.
TEST_F(RunCommand, ADisplayThatFailsEndsNothing) {
  run_without_devices("--no-wait");  // writes the configuration
  const std::string command = "run --duration 2 --config " + in_quotes(scratch() / "flight.toml");
  const auto start = std::chrono::steady_clock::now();
  const Outcome r = run(command, "", " >/dev/full");
  EXPECT_GE(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(), 1.9);
  expect_one_line(r, 1, {"iio:device77"});
}

}  // namespace
}  // namespace epiline
