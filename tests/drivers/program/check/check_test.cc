#include "drivers/program/check/check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "drivers/program/check/image_check.h"
#include "drivers/program/check/line_check.h"
#include "drivers/program/inventory/inventory.h"
#include "tests/drivers/program/inventory/made_up_computer.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

CameraParameters lens(int width, int height) {
  CameraParameters p;
  p.width = width;
  p.height = height;
  p.intrinsics = {300, 300, width / 2., height / 2.};
  return p;
}

/// Boxes of random grey that move a little, blurred.
cv::Mat boxes(int frame, double blur_px, double light = 1) {
  cv::RNG random(3);
  cv::Mat image(240, 320, CV_8U, cv::Scalar(110 * light));
  for (int i = 0; i < 150; ++i) {
    const cv::Point at(random.uniform(-10, 320) + frame, random.uniform(-10, 240));
    cv::rectangle(image, cv::Rect(at, cv::Size(random.uniform(8, 30), random.uniform(8, 30))),
                  cv::Scalar(std::min(255., light * random.uniform(0, 256))), cv::FILLED);
  }
  cv::GaussianBlur(image, image, cv::Size(), blur_px);
  return image;
}

ImageResult look(double blur_px, double light = 1, int lose = 0) {
  ImageCheck check(Camera(lens(320, 240)), {});
  std::vector<cv::Mat> kept;
  for (int i = 0; i < 40; ++i) kept.push_back(boxes(i, blur_px, light));
  for (int i = 0; i < 40; ++i) {
    if (lose > 0 && i % lose == lose - 1) continue;
    Frame f;
    f.stamp = {1'000'000'000 + i * std::int64_t{50'000'000}};
    f.arrival = f.stamp + Span{12'000'000};
    f.sequence = static_cast<std::uint64_t>(i);
    f.data = kept[static_cast<std::size_t>(i)].data;
    f.width = 320;
    f.height = 240;
    f.stride = static_cast<int>(kept[static_cast<std::size_t>(i)].step);
    check.step(f);
  }
  return check.result();
}

/// Of the finding whose text holds `part`; "nothing": there is none.
std::string grade_of(const Findings& findings, const char* part) {
  for (const Finding& f : findings)
    if (f.text.find(part) != std::string::npos) return kGradeNames[static_cast<std::size_t>(f.grade)];
  return "nothing";
}

TEST(ImageCheck, KnowsASharpImageFromABlurredOne) {
  // a Gaussian edge of deviation s rises to its height within s sqrt(2 pi) at its steepest
  for (const double blur : {0.8, 1.2, 2.})
    EXPECT_NEAR(look(blur).edge_width_px, blur * 2.507, 0.2 * blur * 2.507) << blur;
  const Findings sharp = findings_of(look(0.9), 20, 60);
  for (const char* part : {"edges are", "corners found", "mean brightness"}) EXPECT_EQ(grade_of(sharp, part), "ok");
  EXPECT_EQ(grade_of(findings_of(look(2.), 20, 60), "edges are"), "warning");
  for (const double light : {0.02, 6.})
    EXPECT_EQ(grade_of(findings_of(look(0.9, light), 20, 60), "mean brightness"), "error") << light;
}

TEST(ImageCheck, CountsWhatWasLost) {
  const ImageResult r = look(1, 1, 8);
  EXPECT_EQ(r.lost, 4u);
  EXPECT_NEAR(r.pacing.rate_hz(), 20, 1e-6);
  EXPECT_NEAR(r.pacing.delay_s, 0.012, 1e-9);
  EXPECT_EQ(grade_of(findings_of(r, 20, 60), "images lost"), "error");
  EXPECT_EQ(grade_of(findings_of(r, 30, 60), "images per second"), "warning") << "30 were configured";
}

// ---- what is there ----

class Presence : public test::MadeUpComputer {
 protected:
  void SetUp() override {
    MadeUpComputer::SetUp();
    write("sys/class/video4linux/video0/name", "HD USB Camera: HD USB Camera");
    write("sys/bus/iio/devices/iio:device0/name", "icm42600-gyro");
    write("sys/class/net/can0/type", "280");
    write("sys/class/net/can0/operstate", "down");
    write("sys/class/net/eth0/type", "1");
    for (const char* file : {"dev/gpiochip0", "dev/ttyACM0", "dev/spidev0.0"}) write(file);
  }
};

TEST_F(Presence, IsWhatTheKernelLists) {
  const Inventory all = list_devices(root_);
  EXPECT_EQ(to_text(all.cameras), "/dev/video0 (HD USB Camera: HD USB Camera)");
  EXPECT_EQ(to_text(all.iio), "/dev/iio:device0 (icm42600-gyro)");
  EXPECT_EQ(to_text(all.gpio), "/dev/gpiochip0") << "its label only a real chip tells: tests/hardware";
  EXPECT_EQ(to_text(all.serial), "/dev/ttyACM0");
  EXPECT_EQ(to_text(all.spi), "/dev/spidev0.0");
  EXPECT_EQ(to_text(all.can), "can0 (down)") << "no Ethernet";
  EXPECT_EQ(to_text(list_devices(root_ / "nothing").cameras), "none");
}

TEST_F(Presence, NamesWhatIsMissingAndWhatIsThere) {
  const Inventory there = list_devices(root_);
  DevicesConfig d;
  d.camera.device = "/dev/video7-that-is-not-there";
  d.imu.device = "bmi088";
  d.mavlink.serial = "/dev/ttyACM9-that-is-not-there";
  d.can.interface = "can7";
  const Findings missing = check_presence(d, there);
  ASSERT_EQ(missing.size(), 4u);
  for (const Finding& f : missing) {
    EXPECT_EQ(f.grade, Grade::kError) << f.text;
    EXPECT_FALSE(f.remedy.empty()) << f.text;
  }
  EXPECT_EQ(missing[0].text, "/dev/video7-that-is-not-there does not exist");
  EXPECT_NE(missing[0].remedy.find("HD USB Camera"), std::string::npos);
  EXPECT_NE(missing[2].remedy.find("/dev/ttyACM0"), std::string::npos);
  EXPECT_NE(missing[3].remedy.find("can0 (down)"), std::string::npos);
  const Findings nothing = check_presence({}, {});
  ASSERT_EQ(nothing.size(), 2u);
  EXPECT_EQ(nothing[0].text, "camera.device is not set");
  EXPECT_EQ(nothing[1].text, "imu.device is not set");
}

TEST(Check, DeviceRecordsBecomeFindings) {
  DeviceRecord record{"mavlink", {{"packets", 0}, {"bad_checksums", 3, true}, {"pieces", 7}}, ClockState{}};
  Findings all = findings_of(record);
  EXPECT_EQ(grade_of(all, "bad_checksums 3"), "warning");
  EXPECT_EQ(grade_of(all, "pieces"), "nothing");
  EXPECT_EQ(grade_of(all, "nothing received from a flight controller"), "error");
  EXPECT_EQ(grade_of(all, "clock: the device sent no time"), "warning");
  record.counts = {{"packets", 100}};
  record.clock->status = ClockStatus::kLocked;
  all = findings_of(record);
  EXPECT_TRUE(std::all_of(all.begin(), all.end(), [](const Finding& f) { return f.grade == Grade::kOk; }));
  record.clock->status = ClockStatus::kUnusable;
  EXPECT_EQ(grade_of(findings_of(record), "clock:"), "error");
}

TEST(Check, CamerasThatAreNotTriggeredTogetherAreNamed) {
  const auto grade = [](std::uint64_t pairs, std::uint64_t without) {
    return grade_of(findings_of({"second camera paired", {{"pairs", pairs}, {"without", without}, {"unused", 3}}, {}}),
                    "");
  };
  EXPECT_EQ(grade(0, 0), "nothing") << "no image yet";
  EXPECT_EQ(grade(97, 3), "ok");
  EXPECT_EQ(grade(80, 20), "warning");
  EXPECT_EQ(grade(0, 100), "error");
}

TEST(Check, ASecondCameraMustBePresent) {
  DevicesConfig d;
  d.other_cameras[0].device = "/dev/no-second-camera";
  EXPECT_TRUE(has_error(check_presence(d, {}), "second camera"));
}

// ---- edges, wheels ----

TEST(CameraFindings, SayWhereImagesAreRead) {
  const auto text = [](const BufferReading& reading) {
    const Findings findings = findings_of(reading);
    return findings.empty() ? "" : findings[0].text;
  };
  EXPECT_EQ(text({}), "");
  EXPECT_EQ(text({Span::from_milliseconds(1), Span::from_milliseconds(1)}),
            "images are read in the driver's memory, 1.00 ms each time");
  EXPECT_EQ(text({Span::from_milliseconds(20), Span::from_milliseconds(1)}),
            "images are copied once, because reading the driver's memory takes 20.00 ms each time, 20 times as long as "
            "ordinary memory");
}

TEST(CameraFindings, SayWhichClockTheStampsAreOf) {
  CameraConfig config;
  EXPECT_EQ(finding_of_stamps(config).text, "timestamps are the V4L2 driver's");
  config.clock = 1;
  EXPECT_EQ(finding_of_stamps(config).text, "timestamps are by the camera's own clock");
  config.stamp_line = "strobe";
  EXPECT_EQ(finding_of_stamps(config).text, "timestamps are those of the edges of camera.stamp_line");
}

TEST(LineFindings, SayWhetherEdgesAndImagesAgree) {
  EdgeCounts e;
  e.edges = 300;
  e.matched = 280;
  e.unsure = 20;
  e.period = Span{33'333'333};
  e.lag = Span{2'000'000};
  const auto grade = [&e](const char* part) { return grade_of(findings_of(e, {}, "cam-trigger"), part); };
  EXPECT_EQ(grade("30.00 edges per second on cam-trigger, matched to 280 of 300 images"), "ok");
  EXPECT_EQ(grade("missing"), "nothing");
  e.lag = Span{-13'000'000};
  EXPECT_EQ(grade("30.00 edges"), "warning") << "an image may take its neighbour's edge";
  e.missing = 7;
  EXPECT_EQ(grade("7 edges missing on cam-trigger, 0 too early"), "warning");
  e.matched = 3;
  e.mismatched = 100;
  EXPECT_EQ(grade("30.00 edges"), "error");
  e = {};
  e.edges = 300;
  e.unsure = 300;
  EXPECT_EQ(grade("0.00 edges"), "error") << "never sure which is whose";
  e = {};
  EXPECT_EQ(grade("no edges on cam-trigger"), "error");
  EXPECT_EQ(findings_of(e, GpioCounts{10, 0, 1, ENODEV}, "cam-trigger")[0].text,
            "the GPIO chip of cam-trigger disappeared");
}

TEST(CheckDevices, WaitsForNothingWhereNothingOpened) {
  const fs::path file = fs::path(testing::TempDir()) / "epiline_check_nothing.toml";
  std::ofstream(file) << "[camera]\ndevice = \"/dev/no-such-camera\"\n[imu]\ndevice = \"no-such-imu\"\n"
                         "[mavlink]\nserial = \"/dev/no-such-line\"\n[can]\ninterface = \"nocan9\"\n";
  int waited = 0;
  const Findings found = check_devices(file, {.seconds = 10, .set = {}, .watch = [&](double) { return ++waited < 1; }});
  fs::remove(file);
  EXPECT_EQ(waited, 0);
  for (const char* device : {"camera", "imu", "mavlink", "can"}) EXPECT_TRUE(has_error(found, device)) << device;
}

}  // namespace
}  // namespace epiline
