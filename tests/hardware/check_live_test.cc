// `epiline check` on devices that give something: v4l2loopback with a writer, an IMU of the kernel's HID drivers, a
// flight controller on a pseudo terminal, another node on a vcan. What it finds has to be what is there.
#include "drivers/program/check/check.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>

#include "drivers/program/hil/loopback_writer.h"
#include "tests/drivers/links/mavlink/link_peer.h"
#include "tests/hardware/can_support.h"
#include "tests/hardware/resting_imu.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

class CheckDevices : public CanBus {
 protected:
  static constexpr const char* kCamera = "/dev/video42";
  static constexpr int kWidth = 320, kHeight = 240, kWheel = 0x123;

  void SetUp() override {
    CanBus::SetUp();
    if (IsSkipped()) return;
    if (!fs::exists(kCamera)) GTEST_SKIP() << "v4l2loopback is not loaded; expected ./run hardware";
    fs::create_directories(folder_);
    write_file(folder_ / "camera.yaml", plain_camera(kWidth, kHeight));
    constexpr int kBlock = 16;  // squares of one grey, sharp
    std::minstd_rand random;
    std::array<std::uint8_t, kWidth / kBlock*(kHeight / kBlock)> greys{};
    for (std::uint8_t& grey : greys) grey = static_cast<std::uint8_t>(40 + random() % 170);
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x)
        image_[static_cast<std::size_t>(y * kWidth + x)] =
            greys[static_cast<std::size_t>(y / kBlock * (kWidth / kBlock) + x / kBlock)];
  }
  void TearDown() override {
    fs::remove_all(folder_);
    CanBus::TearDown();
  }

  /// Images of the past period, at ten a second; the device says `said_hz`.
  void open_camera(double said_hz) {
    const Status opened = writer_.open(kCamera, kWidth, kHeight, said_hz);
    ASSERT_TRUE(opened) << opened.error().text();
  }
  void feed_camera() {
    images_ = std::make_unique<Again>(10, [this](std::int64_t at_ns) {
      Frame frame;
      frame.stamp = HostStamp{at_ns};
      frame.data = image_.data();
      frame.width = frame.stride = kWidth;
      frame.height = kHeight;
      writer_.write(frame);
    });
  }
  void plug_in_imu() {
    const Status plugged = imu_.hub().plug_in();
    ASSERT_TRUE(plugged) << plugged.error().text();
  }
  void feed_controller() {
    heartbeats_ = std::make_unique<Again>(10, [this](std::int64_t /*at_ns*/) {
      terminal_.peer.read();
      terminal_.peer.heartbeat();
    });
  }
  void feed_bus(std::uint32_t id) {
    frames_ = std::make_unique<Again>(20, [this, id](std::int64_t /*at_ns*/) { node_->say(id, {1, 2, 3, 4}); });
  }

  Findings check(double camera_hz) {
    std::ofstream(folder_ / "flight.toml")
        << "[camera]\ndevice = \"" << kCamera << "\"\nrate_hz = " << camera_hz
        << "\ntrust_stamps = true\nstamp_point = \"start-of-exposure\"\ncalibration = \"" << folder_.string()
        << "/camera.yaml\"\n[imu]\ndevice = \"gyro_3d\"\ndevice_accel = \"accel_3d\"\nrate_hz = 100\n"
           "gyroscope_noise_density = 1e-3\naccelerometer_noise_density = 1e-2\n[mavlink]\nserial = \""
        << terminal_.path() << "\"\n[can]\ninterface = \"" << kBus << "\"\n[wheel]\ninterface = \"" << kBus
        << "\"\nsignal = \"" << kWheel << " 0|16@1- (0.01,0)\"\n";
    CheckOptions options;
    options.seconds = 6;
    const Findings found = check_devices(folder_ / "flight.toml", options);
    for (const Finding& f : found) {
      std::printf("  %-7s  %s: %s; %s\n", kGradeNames[static_cast<std::size_t>(f.grade)], f.device.c_str(),
                  f.text.c_str(), f.remedy.c_str());
    }
    return found;
  }

  const fs::path folder_ = fs::temp_directory_path() / "epiline_check";
  std::array<std::uint8_t, static_cast<std::size_t>(kWidth) * kHeight> image_{};
  LoopbackWriter writer_;
  RestingImu imu_;
  mavlink::PseudoTerminal terminal_;
  std::unique_ptr<Peer> node_;
  std::unique_ptr<Again> images_, heartbeats_, frames_;
};

bool is_found(const Findings& findings, Grade grade, const char* device, const std::string& part) {
  return std::any_of(findings.begin(), findings.end(), [&](const Finding& f) {
    return f.grade == grade && f.device == device && (f.text + "; " + f.remedy).find(part) != std::string::npos;
  });
}
/// Of a finding's text; 0: there is no such finding.
double number_after(const Findings& findings, const std::string& words) {
  for (const Finding& f : findings)
    if (f.text.rfind(words, 0) == 0) return std::strtod(f.text.c_str() + words.size(), nullptr);
  return 0;
}
bool has_errors(const Findings& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.grade == Grade::kError; });
}

TEST_F(CheckDevices, FindsNothingWrongWithWhatIsRight) {
  open_camera(10);
  plug_in_imu();
  node_ = std::make_unique<Peer>(false);
  feed_camera();
  imu_.start();
  feed_controller();
  feed_bus(kWheel);
  Findings found;
  for (int i = 0; i < 3; ++i) {  // a computer that had no time for us for a while gets another chance
    found = check(10);
    if (!has_errors(found)) break;
  }
  EXPECT_FALSE(has_errors(found));
  EXPECT_TRUE(is_found(found, Grade::kOk, "camera", "/dev/video42 is present"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "camera", "10.00 images per second"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "camera", "mean brightness"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "camera", "edges are 1."));
  EXPECT_TRUE(is_found(found, Grade::kOk, "camera", "100 % found again"));
  EXPECT_TRUE(is_found(found, Grade::kWarning, "camera", "the exposure time is unknown")) << "a loopback has none";
  EXPECT_TRUE(is_found(found, Grade::kOk, "imu", "gyro_3d is present"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "imu", "100.0 samples per second"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "imu", "gyroscope noise "));
  const double density = RestingImu::kGyroscopeNoise_rad_s / std::sqrt(RestingImu::kRate_hz);
  EXPECT_NEAR(number_after(found, "gyroscope noise "), density, 0.4 * density);
  EXPECT_TRUE(is_found(found, Grade::kOk, "imu", "gravity 9.8"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "imu", "+1.00) in its axes"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "mavlink", "packets received"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "can", " with 1 identifiers received on vcan7"));
  EXPECT_TRUE(is_found(found, Grade::kOk, "wheel", " with 1 identifiers received on vcan7"));
}

TEST_F(CheckDevices, FindsWhatIsWrong) {
  open_camera(30);
  plug_in_imu();
  feed_camera();
  imu_.start(1 / 9.81);
  node_ = std::make_unique<Peer>(false);
  feed_bus(kWheel + 1);
  const Findings found = check(30);
  EXPECT_TRUE(is_found(found, Grade::kWarning, "camera", "10.00 images per second")) << "30 were said and configured";
  EXPECT_TRUE(is_found(found, Grade::kWarning, "camera", "30 are configured"));
  EXPECT_TRUE(is_found(found, Grade::kError, "imu", "samples are in g"));
  EXPECT_TRUE(is_found(found, Grade::kError, "mavlink", "nothing received from a flight controller"));
  EXPECT_TRUE(is_found(found, Grade::kError, "wheel", "none with 0x123 of wheel.signal"));
}

TEST_F(CheckDevices, FindsDevicesThatGiveNothing) {
  open_camera(10);
  plug_in_imu();
  const Findings found = check(10);
  EXPECT_TRUE(is_found(found, Grade::kError, "camera", "0 images"));
  EXPECT_TRUE(is_found(found, Grade::kError, "imu", "0 samples"));
  EXPECT_TRUE(is_found(found, Grade::kWarning, "can", "no other node sends"))
      << "what we send ourselves is nobody else";
  EXPECT_TRUE(is_found(found, Grade::kError, "wheel", "none with 0x123 of wheel.signal"));
  ASSERT_TRUE(set_bus("down"));
  const Findings down = check(10);
  EXPECT_TRUE(is_found(down, Grade::kError, "can", "is down"));
  EXPECT_TRUE(is_found(down, Grade::kError, "wheel", "is down"));
}

}  // namespace
}  // namespace epiline
