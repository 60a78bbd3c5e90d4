// The camera against the kernel's test driver vivid: formats, stamps, controls.
#include <algorithm>
#include <cstdio>
#include <string>
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

TEST_F(Vivid, TheFirstFormatToBeHadIsTaken) {
  V4l2Settings settings = small_settings();
  settings.formats = {PixelFormat::kY10P, PixelFormat::kY12, PixelFormat::kGrey};  // vivid has no Y10P
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  EXPECT_EQ(camera.format().format, PixelFormat::kY12);
}

TEST_F(Vivid, SaysWhatTheDeviceGivesInstead) {
  V4l2Settings settings = small_settings();
  settings.width = 333;
  const std::string size = error_of_opening(V4l2Camera(settings));
  EXPECT_EQ(size.rfind("/dev/video0: the camera does not offer 333x180 in GREY [camera.width, camera.height, "
                       "camera.format]; expected ",
                       0),
            0u)
      << size;
  EXPECT_NE(size.find("320x180 ("), std::string::npos) << size;
  settings = small_settings();
  settings.rate_hz = 1000;
  const std::string rate = error_of_opening(V4l2Camera(settings));
  EXPECT_EQ(rate.rfind("/dev/video0: the camera does not offer 1000 Hz at GREY 320x180, but takes 60 [camera.rate_hz]; "
                       "expected ",
                       0),
            0u)
      << rate;
  settings = small_settings();
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

TEST_F(Vivid, StampsOfAnotherClockAreRefused) {
  V4l2Settings settings = small_settings();
  settings.controls = {{"wrap_timestamp", 1}};
  V4l2Camera camera(settings);
  ASSERT_OPENS(camera);
  ASSERT_TRUE(read_until(camera, [&] { return camera.counts().bad_stamps > 3; }));
  EXPECT_EQ(camera.counts().frames, 0u);
  EXPECT_EQ(camera.counts().disconnected, 0u) << "the device is well";
}

TEST_F(Vivid, ControlsAreSetWhileItStreams) {
  set_controls(kDevice, {{"brightness", 128}});
  V4l2Camera camera(small_settings());
  ASSERT_OPENS(camera);
  watch(camera, 2, [](const Frame&) {});
  EXPECT_FALSE(camera.request_control(std::string(60, 'x'), 1));
  ASSERT_TRUE(camera.request_control("brightness", 250));
  ASSERT_TRUE(camera.request_control("no_such_control", 1));
  ASSERT_TRUE(camera.request_control("saturation", 1'000));  // 255 is all it takes
  const HeapCallScope heap;
  Frame frame;
  for (int i = 0; i < 8; ++i) {
    ASSERT_TRUE(read_within(camera, frame, kPatience));
    camera.give_back(frame);
  }
  EXPECT_EQ(heap.calls(), 0u);
  ControlChange answer;
  ASSERT_TRUE(camera.control_answer(answer));
  EXPECT_TRUE(answer.is_set);
  EXPECT_EQ(answer.value, 250);
  ASSERT_TRUE(camera.control_answer(answer));
  EXPECT_FALSE(answer.is_set);
  ASSERT_TRUE(camera.control_answer(answer));
  EXPECT_EQ(answer.value, 255) << "as read back";
  // a device that was lost is set up as it was
  set_controls(kDevice, {{"brightness", 10}, {"inject_fatal_streaming_error", 1}});
  ASSERT_TRUE(read_until(camera, [&] { return camera.counts().disconnected == 1 && camera.is_streaming(); }));
  V4l2Device other;
  ASSERT_FALSE(other.open(kDevice, ""));
  std::int64_t value = 0;
  ASSERT_FALSE(other.control("brightness", value));
  EXPECT_EQ(value, 250);
  set_controls(kDevice, {{"brightness", 128}, {"saturation", 128}});
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
