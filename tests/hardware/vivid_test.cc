// The camera against the kernel's test driver vivid: formats, stamps, controls.
#include <algorithm>
#include <cstdio>
#include <vector>

#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/vivid_support.h"

namespace epiline {
namespace {

TEST_F(Vivid, EveryFormatShowsTheSameImage) {
  std::vector<std::uint8_t> grey;
  for (const PixelFormat format :
       {PixelFormat::kGrey, PixelFormat::kY10, PixelFormat::kY12, PixelFormat::kY16, PixelFormat::kYuyv,
        PixelFormat::kNv12, PixelFormat::kYu12, PixelFormat::kRggb8, PixelFormat::kGrbg10, PixelFormat::kBggr12}) {
    SCOPED_TRACE(to_string(format));
    V4l2Settings settings = small_settings();
    settings.formats = {format};
    V4l2Camera camera(settings);
    ASSERT_OPENS(camera);
    EXPECT_EQ(camera.format().format, format);
    EXPECT_NEAR(camera.format().rate_hz, 30, 0.1);
    EXPECT_EQ(camera.copies(), !is_grey_in_place(format));
    watch(camera, 3, [&](const Frame& frame) {
      ASSERT_EQ(frame.width, 320);
      ASSERT_EQ(frame.height, 180);
      EXPECT_LE(frame.arrival.ns, monotonic_ns());
      EXPECT_LT(std::abs((frame.arrival - frame.stamp).ns), 1'000'000'000)
          << "vivid hands images out before their time";
      EXPECT_EQ(is_device_memory(frame.data), is_grey_in_place(format)) << "in place, or copied";
      const auto pixels = pixels_of(frame);
      if (grey.empty()) grey = pixels;
      // formats with colours use 16 to 235 for black to white
      const bool is_narrow =
          format == PixelFormat::kYuyv || format == PixelFormat::kNv12 || format == PixelFormat::kYu12;
      int worst = 0;
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        const double value = is_narrow ? (pixels[i] - 16) * 255.0 / 219.0 : pixels[i];
        worst = std::max(worst, static_cast<int>(std::abs(value - grey[i])));
      }
      EXPECT_LE(worst, is_narrow || is_mosaic(format) ? 2 : 0);
    });
  }
  EXPECT_GT(*std::max_element(grey.begin(), grey.end()) - *std::min_element(grey.begin(), grey.end()), 100);
}

TEST_F(Vivid, SaysWhichControlItDoesNotTake) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"shutter_of_doubt", 1}};
  EXPECT_EQ(
      error_of_opening(V4l2Camera(settings)),
      "/dev/video0: the camera has no control 'shutter_of_doubt' [VIDIOC_QUERY_EXT_CTRL]; expected one that v4l2-ctl "
      "--list-ctrls shows");
  settings.controls = {{"brightness", 300}};
  EXPECT_EQ(
      error_of_opening(V4l2Camera(settings)),
      "/dev/video0: brightness = 255 after setting it [VIDIOC_G_EXT_CTRLS]; expected 300; is it overridden, as by "
      "automatic exposure?");
  settings.controls = {{"string", 1}};
  EXPECT_EQ(
      error_of_opening(V4l2Camera(settings)),
      "/dev/video0: the control 'string' is not a number [VIDIOC_QUERY_EXT_CTRL]; expected a control with a number");
}

TEST_F(Vivid, ControlsAreSetByName) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"brightness", 77},
                       {"gain_automatic", 0},
                       {"gain", 42},
                       {"integer_64_bits", -5'000'000'000},
                       {"horizontal_flip", 1}};
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  V4l2Device other;
  ASSERT_FALSE(other.open(kDevice, ""));
  for (const CameraControl& control : settings.controls) {
    std::int64_t value = 0;
    ASSERT_FALSE(other.control(control.name.c_str(), value));
    EXPECT_EQ(value, control.value) << control.name;
  }
  set_controls(kDevice, {{"brightness", 128}, {"horizontal_flip", 0}, {"gain_automatic", 1}});
}

// The kernel's stamps are whole microseconds: the nanoseconds beyond tell which correction was added.
TEST_F(Vivid, StampsAreBroughtToMidExposure) {
  for (const int start_of_exposure : {0, 1}) {
    for (const Shutter shutter : {Shutter::kGlobal, Shutter::kRolling}) {
      V4l2Settings settings = small_settings();
      settings.controls = {{"timestamp_source", start_of_exposure}, {"integer_32_bits", 41}};
      settings.exposure_control = "integer_32_bits";
      settings.exposure = Span{6};  // the control counts units of 6 ns: 246 ns
      settings.readout = Span{100};
      settings.shutter = shutter;
      V4l2Camera camera(settings);
      ASSERT_OPENS(camera);
      EXPECT_EQ(camera.exposure().ns, 246);
      const int expected = start_of_exposure ? (shutter == Shutter::kGlobal ? 123 : 173)
                                             : (shutter == Shutter::kGlobal ? 1000 - 223 : 1000 - 173);
      HostStamp last;
      watch(camera, 5, [&](const Frame& frame) {
        EXPECT_EQ(frame.stamp.ns % 1000, expected);
        EXPECT_GT(frame.stamp, last);
        EXPECT_LT(std::abs(monotonic_ns() - frame.stamp.ns), kPatience.ns);
        last = frame.stamp;
      });
    }
  }
}

// Of changes by another program the kernel tells; the stamps follow.
TEST_F(Vivid, AnExposureThatAnotherProgramChangesIsKnown) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"timestamp_source", 1}, {"integer_32_bits", 41}};
  settings.exposure_control = "integer_32_bits";
  settings.exposure = Span{6};
  settings.control_of_exposure.delay_images = 2;
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  watch(camera, 2, [&](const Frame& frame) { EXPECT_EQ(frame.stamp.ns % 1000, 123); });
  set_controls(kDevice, {{"integer_32_bits", 81}});
  std::vector<std::int64_t> beyond;
  watch(camera, 12, [&](const Frame& frame) { beyond.push_back(frame.stamp.ns % 1000); });
  EXPECT_EQ(beyond.back(), 243);
  const auto change = std::find(beyond.begin(), beyond.end(), 243);
  EXPECT_GE(change - beyond.begin(), 1) << "not before the delay";
  EXPECT_TRUE(std::all_of(change, beyond.end(), [](std::int64_t b) { return b == 243; })) << "and then it stays";
  EXPECT_EQ(camera.exposure().ns, 486);
}

// Vivid has no exposure, and its grey does not follow brightness as a sensor's would: this is about a real control that
// is changed, read back, and left alone in the end. The loop itself is tested with a played camera.
TEST_F(Vivid, TheExposureControllerComesToRest) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"brightness", 8}};
  settings.exposure_control = "brightness";
  settings.exposure = Span{40'000};
  settings.control_of_exposure.automatic = true;
  settings.control_of_exposure.longest_ms = 10.2;
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  std::uint64_t changes = 0;
  for (int calm = 0, images = 0; calm < 40 && images < 600; ++images) {
    watch(camera, 1, [](const Frame&) {});
    const std::uint64_t now = camera.exposure_report().changes;
    calm = now == changes ? calm + 1 : 0;
    changes = now;
  }
  const ExposureReport report = camera.exposure_report();
  std::printf("exposure: %llu changes, brightness %.0f, %.0f %% clipped, delay %d (%s)\n",
              static_cast<unsigned long long>(report.changes), report.brightness, 100 * report.clipped_share,
              report.delay_images, report.is_delay_known ? "learned" : "assumed");
  EXPECT_GT(report.changes, 0u);
  EXPECT_LT(report.changes, 40u);
  EXPECT_EQ(report.refused, 0u);
  EXPECT_GT(report.brightness, 50);
  EXPECT_LT(report.clipped_share, 0.5);
  set_controls(kDevice, {{"brightness", 128}});
}

TEST_F(Vivid, ClosingTakesLentImagesBack) {
  V4l2Camera camera(small_settings());
  const int files = open_files();
  for (int i = 0; i < 3; ++i) {
    ASSERT_OPENS(camera);
    Frame frame;
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    camera.close();
    EXPECT_TRUE(device_mappings().empty());
    EXPECT_EQ(open_files(), files);
  }
}

TEST_F(Vivid, ReadingUsesNoHeapAndNoLocks) {
  for (const PixelFormat format : {PixelFormat::kGrey, PixelFormat::kYuyv}) {
    V4l2Settings settings = small_settings();
    settings.formats = {format};
    V4l2Camera camera(settings);
    ASSERT_OPENS(camera);
    const HeapCallScope heap;
    const std::uint64_t locks = lock_calls_of_this_thread();
    for (int i = 0; i < 20; ++i) {
      Frame frame;
      ASSERT_TRUE(read_within(camera, frame, kPatience));
      camera.give_back(frame);
    }
    EXPECT_EQ(heap.calls(), 0u);
    EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
  }
}

}  // namespace
}  // namespace epiline
