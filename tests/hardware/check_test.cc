// `check` on kernel drivers: a bus on which somebody talks, or only we; lines with edges; a camera.
#include "drivers/program/check/check.h"

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/hardware/camera_support.h"
#include "tests/hardware/can_support.h"
#include "tests/hardware/gpio_support.h"

namespace epiline {
namespace {

class CheckOfTheKernel : public CanBus {
 protected:
  void SetUp() override {
    CanBus::SetUp();
    std::filesystem::create_directories(folder_);
    write_file(folder_ / "camera.yaml", plain_camera(320, 180));
  }
  void TearDown() override {
    std::filesystem::remove_all(folder_);
    CanBus::TearDown();
  }
  /// `camera`: further entries of [camera]; `rest`: further sections.
  Findings check(const std::string& camera, const std::string& rest, double seconds) {
    std::ofstream(folder_ / "check.toml")
        << "[camera]\ncalibration = \"" << (folder_ / "camera.yaml").string() << "\"\n"
        << camera << "[imu]\ndevice = \"no-such-imu\"\n"
        << rest;
    const Findings findings = check_devices(folder_ / "check.toml", {.seconds = seconds, .set = {}, .watch = {}});
    for (const Finding& f : findings)
      std::printf("%-8s %s: %s\n", kGradeNames[static_cast<std::size_t>(f.grade)], f.device.c_str(), f.text.c_str());
    return findings;
  }
  static std::string grade(const Findings& findings, const std::string& device, const std::string& part) {
    for (const Finding& f : findings)
      if (f.device == device && f.text.find(part) != std::string::npos)
        return kGradeNames[static_cast<std::size_t>(f.grade)];
    return "nothing";
  }

  const std::filesystem::path folder_ = std::filesystem::temp_directory_path() / "epiline_check";
};

constexpr const char* kNoCamera = "device = \"/dev/no-such-camera\"\n";

// More frames than the kernel keeps come before the wheel's first one.
TEST_F(CheckOfTheKernel, WheelsAreHeardOnABusyBus) {
  const char* const kWheel = "[wheel]\ninterface = \"vcan7\"\nsignal = \"0x123 0|16@1- (0.01,0)\"\n";
  Peer sender(false);
  int said = 0;
  const Again hand(500, [&](std::int64_t) {
    do {
      sender.say(0x200, {1, 2, 3});
    } while (++said < 5'000);
    if (said % 10 == 0) sender.say(0x123, {static_cast<std::uint8_t>(said % 100), 1});
  });
  const Findings heard = check(kNoCamera, kWheel, 10);
  EXPECT_EQ(grade(heard, "wheel", "speeds per second"), "ok");
  EXPECT_EQ(grade(heard, "wheel", "frames with 2 identifiers received on vcan7"), "ok");
}

// Lines are looked at though the devices that they belong to are not there.
TEST_F(CheckOfTheKernel, LinesOfMissingDevicesAreLookedAt) {
  const SimulatedGpio gpio("check-board", {"strobe", "quiet"});
  EXPECT_NE(to_text(list_devices().gpio).find("/dev/" + gpio.chip() + " (check-board)"), std::string::npos);
  bool high = false;
  const Again hand(50, [&](std::int64_t) { gpio.set(0, high = !high); });
  const std::string imu = "driver = \"icm42688p\"\nready_line = \"";
  Findings found = check(std::string(kNoCamera) + "stamp_line = \"strobe\"\n", imu + "quiet\"\n", 4);
  EXPECT_EQ(grade(found, "camera", "edges per second on strobe"), "ok");
  EXPECT_EQ(grade(found, "imu", "0 edges on quiet"), "warning");
  found = check(kNoCamera, imu + "flash\"\n", 1);
  EXPECT_EQ(grade(found, "imu", "GPIO line flash: no line has this name"), "error");
}

// vivid takes no trigger; its images and the edges run apart, or no edges come at all.
TEST_F(CheckOfTheKernel, ImagesAndTheirStampLineAreJudged) {
  const SimulatedGpio gpio("check-board", {"strobe"});
  const Findings found = check(
      "device = \"/dev/video0\"\nwidth = 320\nheight = 180\nrate_hz = 5\nformat = \"GREY\"\nstamp_line = \"strobe\"\n"
      "silence_ms = 60000\n",
      "", 6);
  EXPECT_EQ(grade(found, "camera", "/dev/video0 is present"), "ok");
  EXPECT_EQ(grade(found, "camera", "no edges on strobe"), "error");
  EXPECT_EQ(grade(found, "camera", "0 images"), "error") << "none without an edge";
}

}  // namespace
}  // namespace epiline
