// Against a made-up camera, in its own time. tests/hardware has the kernel's drivers.
#include "drivers/sensors/camera/v4l2_camera.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

std::string error_of(V4l2Settings settings) {
  V4l2Camera camera(std::move(settings));
  const Status status = camera.open();
  return status ? "opened" : status.error().text();
}

TEST(V4l2Camera, SaysWhatIsWrongWithTheDevice) {
  EXPECT_EQ(error_of({.device = "/dev/no-such-camera"}),
            "/dev/no-such-camera: No such file or directory [open]; expected a connected device (epiline devices lists "
            "them)");
  EXPECT_EQ(error_of({.device = "/dev/null"}),
            "/dev/null: not a V4L2 device [VIDIOC_QUERYCAP]; expected a V4L2 device");
  EXPECT_EQ(error_of({.device = "Wonder Cam"}),
            "/dev/video*: no camera is called 'Wonder Cam' [open]; expected a camera's path, name or bus (epiline "
            "devices lists them)");
  EXPECT_EQ(error_of({.device = "/dev/null", .buffers = 1}), "/dev/null: camera.buffers = 1; expected 2 to 16");
}

TEST(V4l2Camera, AFailedOpenLeavesNothingBehind) {
  const auto open_files = [] {
    int count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
    return count;
  };
  const int before = open_files();
  error_of({.device = "/dev/null"});
  error_of({.device = "/dev/no-such-camera"});
  EXPECT_EQ(open_files(), before);
}

// ---- a camera ----

using test::CameraRig;
using test::FakeCamera;
using test::kMs;
using test::kSecond_ns;

TEST(V4l2Camera, LendsImagesOfTheDriverAsTheyCome) {
  CameraRig rig;
  rig.open();
  std::optional<Frame> last;
  const std::size_t count = rig.run(10, [&](const Frame& frame) {
    ASSERT_EQ(frame.width, 320);
    ASSERT_EQ(frame.height, 180);
    ASSERT_EQ(frame.data[0], 77);
    ASSERT_LE((frame.arrival - frame.stamp).ns, 1 * kMs);
    if (last) {
      ASSERT_EQ(frame.sequence, last->sequence + 1);
      ASSERT_NEAR(static_cast<double>((frame.stamp - last->stamp).ns), 1e9 / 30, 2'000);
    }
    last = frame;
  });
  EXPECT_NEAR(static_cast<double>(count), 300, 1);
  EXPECT_EQ(rig.failures, 0u);
  EXPECT_EQ(rig.heap_calls, 0u);
  EXPECT_EQ(rig.camera->counts().frames, count);
  EXPECT_EQ(rig.camera->counts().lost + rig.camera->counts().bad_stamps, 0u);
  EXPECT_FALSE(rig.camera->copies());
  rig.camera->close();
  EXPECT_EQ(rig.kernel.open_files(), 0u);
  EXPECT_EQ(rig.kernel.mappings, 0);
}

TEST(V4l2Camera, CopiesWhatIsNotGreyInPlace) {
  CameraRig rig;
  rig.device->formats[0].fourcc = V4L2_PIX_FMT_YUYV;
  rig.settings.formats = {PixelFormat::kGrey, PixelFormat::kYuyv};
  rig.open();
  EXPECT_TRUE(rig.camera->copies());
  EXPECT_NEAR(static_cast<double>(rig.run(1)), 30, 1);
  EXPECT_EQ(rig.heap_calls, 0u);
  const int mappings = rig.kernel.mappings;
  EXPECT_GE(mappings, 2);
  rig.device->dequeue_error = EIO;
  EXPECT_NEAR(static_cast<double>(rig.run(1)), 29, 2);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.kernel.mappings, mappings) << "those of the lost device are undone";
  rig.camera->close();
  EXPECT_EQ(rig.kernel.open_files(), 0u);
  EXPECT_EQ(rig.kernel.mappings, 0);
}

TEST(V4l2Camera, ImagesInMemoryThatIsSlowToReadAreCopiedOnce) {
  for (const bool exports : {true, false}) {
    CameraRig rig;
    rig.device->exports = exports;
    rig.kernel.read_time_of = [&rig](const void* memory) {
      return Span::from_milliseconds(rig.device->owns(memory) ? 20 : 1);
    };
    rig.open();
    EXPECT_TRUE(rig.camera->copies());
    EXPECT_EQ(rig.camera->reading().in_place.ns, 20 * kMs);
    EXPECT_EQ(rig.camera->reading().ordinary.ns, 1 * kMs);
    const std::size_t images = rig.run(1, [&](const Frame& frame) {
      ASSERT_FALSE(rig.device->owns(frame.data));
      ASSERT_EQ(frame.data[0], 77);
    });
    EXPECT_NEAR(static_cast<double>(images), 30, 1);
    EXPECT_EQ(rig.device->readings, exports ? static_cast<int>(images) : 0);
    EXPECT_EQ(rig.heap_calls, 0u);
    rig.device->dequeue_error = EIO;
    EXPECT_NEAR(static_cast<double>(rig.run(1)), 29, 2) << "as before, when it was lost";
    rig.camera->close();
    EXPECT_EQ(rig.kernel.open_files(), 0u);
    EXPECT_EQ(rig.kernel.mappings, 0);
  }
}

TEST(V4l2Camera, ImagesInMemoryThatIsFastEnoughAreLent) {
  CameraRig rig;
  rig.kernel.read_time_of = [&rig](const void* memory) { return Span{rig.device->owns(memory) ? 190'000 : 100'000}; };
  rig.open();
  EXPECT_FALSE(rig.camera->copies());
  rig.run(1, [&](const Frame& frame) { ASSERT_TRUE(rig.device->owns(frame.data)); });
  EXPECT_EQ(rig.device->readings, 0);
}

TEST(V4l2Camera, DecodesJpegAndCountsThatWhichIsNotWhole) {
  CameraRig rig;
  rig.device->formats = {{V4L2_PIX_FMT_YUYV, {{320, 180, {10}}}}, {V4L2_PIX_FMT_MJPEG, {{320, 180, {30}}}}};
  const cv::Mat half(180, 320, CV_8U, cv::Scalar(40));
  half.colRange(160, 320).setTo(200);
  cv::imencode(".jpg", half, rig.device->jpeg);
  rig.settings.formats = V4l2Settings().formats;
  rig.open();
  EXPECT_EQ(rig.camera->format().format, PixelFormat::kMjpeg) << "YUYV comes at 10 Hz only";
  rig.device->change_image = [](FakeCamera::Image& image) {
    if (image.sequence % 10 == 7) image.missing_bytes = 20;
  };
  const std::size_t count = rig.run(1, [](const Frame& frame) {
    ASSERT_EQ(frame.width, 320);
    ASSERT_EQ(frame.height, 180);
    const std::uint8_t* const row = frame.data + std::ptrdiff_t{90} * frame.stride;
    ASSERT_NEAR(row[80], 40, 2);
    ASSERT_NEAR(row[240], 200, 2);
  });
  EXPECT_EQ(rig.camera->counts().damaged, 3u);
  EXPECT_NEAR(static_cast<double>(count), 27, 1);
  EXPECT_EQ(rig.heap_calls, 0u);
  rig.device->dequeue_error = EIO;
  EXPECT_GT(rig.run(1), 20u) << "after it was lost";
  EXPECT_EQ(rig.heap_calls, 0u);
}

TEST(V4l2Camera, OfAMosaicComesHalfTheSize) {
  CameraRig rig;
  rig.device->formats = {{V4L2_PIX_FMT_SRGGB8, {{640, 360, {30}}, {1456, 1088, {30}}}}};
  rig.settings.formats = V4l2Settings().formats;
  rig.open();
  EXPECT_EQ(rig.camera->format().format, PixelFormat::kRggb8);
  EXPECT_EQ(rig.camera->format().width, 640);
  EXPECT_NEAR(static_cast<double>(rig.run(1,
                                          [](const Frame& frame) {
                                            ASSERT_EQ(frame.width, 320);
                                            ASSERT_EQ(frame.height, 180);
                                            ASSERT_EQ(frame.data[0], 77);
                                          })),
              30, 1);
  EXPECT_EQ(rig.heap_calls, 0u);
  rig.camera.reset();
  rig.settings.width = 1456;
  rig.settings.height = 1088;
  EXPECT_EQ(rig.error(),
            "/dev/video0: the camera does not offer 1456x1088 in any format that epiline reads [camera.width, "
            "camera.height, camera.format]; expected RGGB, halved: 320x180 (30 Hz), 728x544 (30 Hz)");
}

// Their driver declares the end of a frame; see docs/camera.md.
TEST(V4l2Camera, ReceiversOfCsiStampTheFirstRow) {
  for (const char* driver : {"rp1-cfe", "unicam", "uvcvideo"}) {
    SCOPED_TRACE(driver);
    CameraRig rig;
    rig.device->driver = driver;
    rig.settings.exposure = Span::from_milliseconds(4);
    rig.settings.readout = Span::from_milliseconds(10);
    rig.settings.shutter = Shutter::kRolling;
    rig.open();
    rig.run(1);
    // what was stamped in the middle of the made-up camera's life, to the middle row's middle
    const double to_middle_ms = driver == std::string("uvcvideo") ? -10 + 5 - 2 : 5 - 2;
    EXPECT_NEAR(1e-6 * static_cast<double>((rig.last.stamp - rig.last.arrival).ns), to_middle_ms, 1);
    rig.camera.reset();
    rig.settings.stamp_point = StampPoint::kStartOfExposure;
    rig.open();
    rig.run(1);
    EXPECT_NEAR(1e-6 * static_cast<double>((rig.last.stamp - rig.last.arrival).ns), 2 + 5, 1) << "what is set wins";
  }
}

TEST(V4l2Camera, CountsWhatIsDamagedCutShortOrLost) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.device->change_image = [](FakeCamera::Image& image) {
    if (image.sequence % 10 == 3) image.flags |= V4L2_BUF_FLAG_ERROR;
    if (image.sequence % 10 == 7) image.missing_bytes = 1;
    if (image.sequence >= 45) image.sequence += 5;
  };
  const std::size_t count = rig.run(1);
  const CameraCounts counts = rig.camera->counts();
  EXPECT_EQ(counts.damaged, 3u);
  EXPECT_EQ(counts.incomplete, 3u);
  EXPECT_EQ(counts.lost, 5u);
  EXPECT_NEAR(static_cast<double>(count), 24, 1);
  EXPECT_EQ(counts.disconnected, 0u);
  EXPECT_EQ(rig.last.sequence, counts.frames - 1 + counts.damaged + counts.incomplete + counts.lost);
}

TEST(V4l2Camera, RefusesStampsOfAnotherClock) {
  CameraRig rig;
  rig.open();
  rig.device->change_image = [](FakeCamera::Image& image) { image.stamp_ns -= 3'600 * kSecond_ns; };
  EXPECT_EQ(rig.run(3), 0u);
  EXPECT_NEAR(static_cast<double>(rig.camera->counts().bad_stamps), 90, 1);
  EXPECT_EQ(rig.camera->counts().disconnected, 0u) << "the device is well";
  CameraRig unknown;
  unknown.device->stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  EXPECT_EQ(unknown.error(),
            "/dev/video0: its driver does not declare monotonic timestamps; expected monotonic timestamps; "
            "camera.trust_stamps = true if they are");
}

TEST(V4l2Camera, AnErrorOfTheDeviceIsOvercomeAtOnce) {
  for (const bool at_dequeue : {true, false}) {
    CameraRig rig;
    rig.open();
    rig.run(1);
    const std::size_t files = rig.kernel.open_files();
    const int mappings = rig.kernel.mappings;
    const std::uint64_t before = rig.last.sequence;
    (at_dequeue ? rig.device->dequeue_error : rig.device->queue_error) = EIO;
    EXPECT_NEAR(static_cast<double>(rig.run(1)), 29, 2);
    EXPECT_EQ(rig.failures, 1u) << "told once";
    EXPECT_EQ(rig.camera->counts().disconnected, 1u);
    EXPECT_EQ(rig.camera->counts().retries, 0u);
    EXPECT_EQ(rig.camera->counts().last_error, EIO);
    EXPECT_GT(rig.first.sequence, before + 1) << "a gap: nobody knows how many were lost";
    EXPECT_EQ(rig.kernel.open_files(), files);
    EXPECT_EQ(rig.kernel.mappings, mappings);
    EXPECT_EQ(rig.heap_calls, 0u);
  }
}

TEST(V4l2Camera, AStreamThatBreaksOffSilentlyIsOvercomeAtOnce) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.device->gives_images = false;
  rig.device->is_broken = true;
  rig.run(0.1);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u) << "before its silence is noticed";
  EXPECT_EQ(rig.camera->counts().last_error, EIO);
  rig.device->gives_images = true;
  EXPECT_GT(rig.run(1), 20u);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
}

TEST(V4l2Camera, AnUnpluggedCameraIsTriedAtGrowingIntervals) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.unplug();
  EXPECT_EQ(rig.run(10.3), 0u);
  EXPECT_FALSE(rig.camera->is_streaming());
  // at once, after 50, 100, 200, 400, 800 ms, then each second
  EXPECT_EQ(rig.camera->counts().retries, 14u);
  EXPECT_EQ(rig.camera->counts().last_error, ENOENT);
  EXPECT_EQ(rig.kernel.mappings, 0);
  rig.plug_in();
  EXPECT_GT(rig.run(1.5), 10u);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.heap_calls, 0u);
}

TEST(V4l2Camera, ASilentCameraIsOpenedAgain) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.device->gives_images = false;
  rig.run(1.9);
  EXPECT_EQ(rig.camera->counts().disconnected, 0u);
  rig.run(0.3);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.camera->counts().last_error, 0);
  rig.device->gives_images = true;
  EXPECT_GT(rig.run(1), 20u);
}

TEST(V4l2Camera, WhatTheDeviceRefusesAtTheStartIsNamed) {
  for (const auto& [request, step] :
       {std::pair{VIDIOC_REQBUFS, "VIDIOC_REQBUFS"}, std::pair{VIDIOC_QUERYBUF, "VIDIOC_QUERYBUF"},
        std::pair{VIDIOC_QBUF, "VIDIOC_QBUF"}, std::pair{VIDIOC_STREAMON, "VIDIOC_STREAMON"},
        std::pair{VIDIOC_G_FMT, "VIDIOC_G_FMT"}}) {
    CameraRig rig;
    rig.device->refused_request = request;
    EXPECT_EQ(rig.error(), std::string("/dev/video0: Invalid argument [") + step + "]");
    EXPECT_EQ(rig.kernel.open_files(), 0u) << step;
    EXPECT_EQ(rig.kernel.mappings, 0) << step;
  }
}

TEST(V4l2Camera, AFailedAttemptToReopenIsRepeated) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.device->dequeue_error = EIO;
  rig.device->refused_request = VIDIOC_STREAMON;
  rig.run(0.1);
  rig.device->refused_request = 0;
  EXPECT_GT(rig.run(0.5), 5u);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.camera->counts().retries, 2u) << "at once, and after 50 ms";
}

TEST(V4l2Camera, LentImagesOutliveTheDevice) {
  CameraRig rig;
  rig.open();
  std::vector<Frame> lent(3);
  for (Frame& frame : lent) ASSERT_EQ(rig.camera->read(frame, Span{kSecond_ns}), ReadOutcome::kSample);
  const int mappings = rig.kernel.mappings;
  rig.device->dequeue_error = ENODEV;
  rig.run(0.5);
  EXPECT_EQ(rig.kernel.mappings, mappings + 3);
  for (const Frame& frame : lent) {
    EXPECT_EQ(frame.data[0], 77);
    EXPECT_NE(frame.slot, rig.last.slot);
    rig.camera->give_back(frame);
  }
  rig.run(0.5);
  EXPECT_EQ(rig.kernel.mappings, mappings) << "given back, then unmapped";
}

TEST(V4l2Camera, WithEverythingLentItWaitsUntilOneIsGivenBack) {
  CameraRig rig;
  rig.settings.buffers = 4;
  rig.open();
  std::vector<Frame> lent(4);
  for (Frame& frame : lent) ASSERT_EQ(rig.camera->read(frame, Span{kSecond_ns}), ReadOutcome::kSample);
  Frame frame;
  ASSERT_EQ(rig.camera->read(frame, Span::from_milliseconds(100)), ReadOutcome::kTimeout) << "not failed";
  rig.kernel.at(rig.kernel.clock_ns + 50 * kMs, [&] { rig.camera->give_back(lent[2]); });
  ASSERT_EQ(rig.camera->read(frame, Span::from_milliseconds(100)), ReadOutcome::kSample);
  EXPECT_EQ(frame.slot, lent[2].slot);
  EXPECT_EQ(rig.camera->counts().disconnected, 0u);
}

TEST(V4l2Camera, ControlsAreSetWhileItStreamsAndAgainWhenItIsBack) {
  CameraRig rig;
  rig.open();
  rig.run(0.1);
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  ASSERT_TRUE(rig.camera->request_control("no_such_control", 1));
  ASSERT_TRUE(rig.camera->request_control("exposure_time_absolute", 1'000));  // 255 is all it takes
  rig.run(0.2);
  EXPECT_EQ(rig.heap_calls, 0u);
  ControlChange answer;
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_TRUE(answer.is_set);
  EXPECT_EQ(answer.value, 250);
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_FALSE(answer.is_set);
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_EQ(answer.value, 255) << "as read back";
  EXPECT_FALSE(rig.camera->control_answer(answer));
  rig.device->control("Brightness").value = 10;
  rig.device->dequeue_error = EIO;
  rig.run(0.2);
  EXPECT_EQ(rig.device->control("Brightness").value, 250);
}

// ---- which camera comes back ----

TEST(V4l2Camera, AnotherCameraIsNotTakenForTheOneThatWasLost) {
  for (const auto& [card, bus] :
       {std::pair{"Other Cam", "usb-0000:00:14.0-1"}, std::pair{"Made-up Cam", "usb-0000:00:14.0-2"}}) {
    SCOPED_TRACE(std::string(card) + ", " + bus);
    CameraRig rig;
    rig.open();
    rig.run(1);
    rig.unplug();
    const auto other = std::make_shared<FakeCamera>(rig.kernel);
    other->card = card;
    other->bus = bus;
    rig.kernel.devices["/dev/video0"] = other;
    EXPECT_EQ(rig.run(5), 0u);
    EXPECT_GE(rig.camera->counts().other_camera, 5u);
    EXPECT_EQ(rig.camera->counts().last_error, 0);
    rig.plug_in("/dev/video3");
    EXPECT_GT(rig.run(2), 20u);
    EXPECT_EQ(rig.camera->counts().disconnected, 1u);
    EXPECT_EQ(rig.heap_calls, 0u);
  }
}

TEST(V4l2Camera, OfSeveralNodesOnOneBusTheCamerasOwnIsTaken) {
  CameraRig rig;
  rig.settings.device = "Made-up Cam";
  const auto infrared = std::make_shared<FakeCamera>(rig.kernel);
  infrared->card = "Made-up Cam: Infrared";
  rig.unplug();
  rig.kernel.devices["/dev/video0"] = infrared;
  rig.plug_in("/dev/video2");
  rig.open();
  rig.run(1);
  rig.unplug("/dev/video2");
  EXPECT_EQ(rig.run(3), 0u);
  rig.plug_in("/dev/video4");
  EXPECT_GT(rig.run(2), 20u);
}

// Its path has the serial number in it, so that it is known wherever it is plugged in.
TEST(V4l2Camera, ACameraNamedByItsSerialNumberMayComeBackAnywhere) {
  CameraRig rig;
  rig.settings.device = "/dev/v4l/by-id/usb-Made-up_Cam_4711-video-index0";
  rig.unplug();
  rig.plug_in(rig.settings.device);
  rig.open();
  rig.run(1);
  rig.unplug(rig.settings.device);
  rig.run(1);
  rig.device->bus = "usb-0000:00:14.0-7";
  rig.plug_in(rig.settings.device);
  EXPECT_GT(rig.run(2), 20u);
  EXPECT_EQ(rig.camera->counts().other_camera, 0u);
}

// ---- what it offers ----

TEST(V4l2Camera, ListsSizesFormatsAndRatesToWhoAsksForOthers) {
  const auto error = [](const std::function<void(CameraRig&)>& change) {
    CameraRig rig;
    rig.device->formats.push_back({V4L2_PIX_FMT_MJPEG, {{1280, 720, {30}}}});
    rig.device->formats.push_back({V4L2_PIX_FMT_YUYV, {{640, 480, {10, 15}}}});
    rig.device->formats.push_back({V4L2_PIX_FMT_H264, {}});
    change(rig);
    return rig.error();
  };
  const std::string what = "/dev/video0: the camera does not offer ";
  const std::string list =
      " [camera.width, camera.height, camera.format]; expected GREY 320x180 (30, 60 Hz), 640x480 (30 Hz); MJPG "
      "1280x720 (30 Hz); YUYV "
      "640x480 "
      "(10, 15 Hz); not read: H264";
  EXPECT_EQ(error([](CameraRig& rig) { rig.settings.width = 333; }), what + "333x180 in GREY" + list);
  EXPECT_EQ(error([](CameraRig& rig) { rig.settings.formats = {PixelFormat::kY10}; }), what + "320x180 in Y10" + list);
  EXPECT_EQ(error([](CameraRig& rig) {
              rig.settings.formats = V4l2Settings().formats;
              rig.settings.width = 1920;
              rig.settings.height = 1080;
            }),
            what + "1920x1080 in any format that epiline reads" + list);
  EXPECT_EQ(error([](CameraRig& rig) { rig.settings.rate_hz = 45; }),
            "/dev/video0: the camera does not offer 45 Hz at GREY 320x180, but takes 30 [camera.rate_hz]; expected 30, "
            "60");
  EXPECT_EQ(error([](CameraRig& rig) { rig.device->refused_request = VIDIOC_S_FMT; }), what + "320x180 in GREY" + list);
}

TEST(V4l2Camera, ARateThatCannotBeSetIsAnError) {
  CameraRig rig;
  rig.device->has_rate = false;
  EXPECT_EQ(rig.error(),
            "/dev/video0: the camera's rate cannot be set [camera.rate_hz]; expected 0, which keeps the rate that the "
            "camera has");
  rig.settings.rate_hz = 0;
  EXPECT_EQ(rig.error(), "opened");
}

TEST(V4l2Camera, ALongListOfOffersEndsInDots) {
  CameraRig rig;
  for (unsigned i = 1; i < 200; ++i) rig.device->formats[0].sizes.push_back({10 * i, 10 * i, {5, 10, 15, 20, 25, 30}});
  rig.settings.width = 333;
  const std::string error = rig.error();
  EXPECT_EQ(error.substr(error.size() - 3), "...");
  EXPECT_LT(error.size(), 700u);
}

// ---- stamps that cannot be ----

TEST(V4l2Camera, OneStampInTheFutureCostsOneImage) {
  for (const bool trusts : {false, true}) {
    for (const std::int64_t ahead_ns : {50 * kMs, 900 * kMs, 3'600 * kSecond_ns}) {
      SCOPED_TRACE(std::to_string(ahead_ns) + (trusts ? " ns, trusted" : " ns"));
      CameraRig rig;
      rig.settings.trust_stamps = trusts;
      rig.open();
      rig.device->change_image = [&](FakeCamera::Image& image) {
        if (image.sequence == 40) image.stamp_ns += ahead_ns;
      };
      HostStamp before;
      rig.run(5, [&](const Frame& frame) {
        EXPECT_GT(frame.stamp, before);
        before = frame.stamp;
      });
      EXPECT_EQ(rig.camera->counts().bad_stamps, 1u);
      EXPECT_NEAR(static_cast<double>(rig.camera->counts().frames), 149, 1);
    }
  }
}

TEST(V4l2Camera, AStampOnTheWayIsNotInTheFuture) {
  CameraRig rig;  // as drivers that compute the end of a frame do, and hand the image out before it
  rig.open();
  rig.device->change_image = [&](FakeCamera::Image& image) { image.stamp_ns += rig.device->period_ns() - kMs; };
  EXPECT_NEAR(static_cast<double>(rig.run(3)), 90, 1);
  EXPECT_EQ(rig.camera->counts().bad_stamps, 0u);
}

TEST(V4l2Camera, AClockThatIsSetIsBelievedWhenItLasts) {
  for (const std::int64_t step_ns : {-3'600 * kSecond_ns, -500 * kMs, 500 * kMs, 3'600 * kSecond_ns}) {
    SCOPED_TRACE(step_ns);
    CameraRig rig;
    rig.settings.trust_stamps = true;
    rig.open();
    rig.run(2);
    rig.device->change_image = [&](FakeCamera::Image& image) { image.stamp_ns += step_ns; };
    EXPECT_NEAR(static_cast<double>(rig.run(3)), 86, 1);
    EXPECT_EQ(rig.camera->counts().bad_stamps, 4u);
    EXPECT_NEAR(static_cast<double>((rig.last.stamp - rig.last.arrival).ns), static_cast<double>(step_ns), 2e6);
  }
}

TEST(V4l2Camera, AStuckStampIsNeverBelieved) {
  CameraRig rig;
  rig.settings.trust_stamps = true;
  rig.open();
  rig.run(2);
  const std::int64_t stuck_ns = rig.kernel.clock_ns + 100 * kSecond_ns;
  rig.device->change_image = [&](FakeCamera::Image& image) { image.stamp_ns = stuck_ns; };
  EXPECT_EQ(rig.run(3), 0u);
}

TEST(V4l2Camera, ANewStreamBeginsWithoutTheStampsOfTheOneBefore) {
  CameraRig rig;
  rig.settings.trust_stamps = true;
  rig.open();
  rig.run(2);
  rig.device->dequeue_error = EIO;
  rig.device->change_image = [](FakeCamera::Image& image) { image.stamp_ns -= 3'600 * kSecond_ns; };
  EXPECT_NEAR(static_cast<double>(rig.run(2)), 59, 2);
  EXPECT_EQ(rig.camera->counts().bad_stamps, 0u);
}

// ---- slow controls ----

// A USB camera that does not answer a control transfer holds its caller for 5 s.
TEST(V4l2Camera, ASlowControlCostsNoImage) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.device->control_ns = rig.kernel.side_ns = 5 * kSecond_ns;
  const std::size_t files = rig.kernel.open_files();
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  EXPECT_NEAR(static_cast<double>(rig.run(6)), 180, 1);
  EXPECT_EQ(rig.camera->counts().lost, 0u);
  EXPECT_EQ(rig.heap_calls, 0u);
  EXPECT_EQ(rig.kernel.open_files(), files) << "the transfer's own are closed";
  ControlChange answer;
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_TRUE(answer.is_set);
  EXPECT_EQ(rig.device->control("Brightness").value, 250);
}

TEST(V4l2Camera, ASlowChangeOfExposureCostsNoImage) {
  CameraRig rig;
  rig.settings.exposure_control = "exposure_time_absolute";
  rig.settings.exposure = Span{100'000};
  rig.settings.control_of_exposure.automatic = true;
  rig.settings.control_of_exposure.longest_ms = 20;
  rig.settings.control_of_exposure.brightness = 200;  // the made-up camera's images are darker
  rig.open();
  rig.device->control_ns = rig.kernel.side_ns = 2 * kSecond_ns;
  EXPECT_NEAR(static_cast<double>(rig.run(10)), 300, 1);
  EXPECT_EQ(rig.camera->counts().lost, 0u);
  EXPECT_EQ(rig.heap_calls, 0u);
  const std::uint64_t changes = rig.camera->exposure_report().changes;
  EXPECT_GE(changes, 2u);
  EXPECT_LE(changes, 5u) << "one at a time, each seen before the next";
  EXPECT_GT(rig.device->control("Exposure Time, Absolute").value, 40);
}

TEST(V4l2Camera, ASecondCameraIsExposedAsTheFirst) {
  CameraRig first, second, third;
  for (CameraRig* rig : {&first, &second, &third}) {
    rig->settings.exposure_control = "exposure_time_absolute";
    rig->settings.exposure = Span{100'000};
  }
  first.settings.control_of_exposure.automatic = true;
  first.settings.control_of_exposure.longest_ms = 20;
  first.settings.control_of_exposure.brightness = 200;
  first.open();
  second.open();
  second.camera->follow_exposure_of(*first.camera);
  second.run(1);
  EXPECT_EQ(second.camera->exposure_report().changes, 0u) << "there is nothing to follow yet";
  first.run(10);
  const auto exposure = [](const CameraRig& rig) { return rig.device->control("Exposure Time, Absolute").value; };
  EXPECT_GT(exposure(first), 40);
  EXPECT_NEAR(static_cast<double>(second.run(2)), 60, 1);
  EXPECT_EQ(exposure(second), exposure(first));
  EXPECT_EQ(second.heap_calls, 0u);
  EXPECT_EQ(second.camera->exposure_report().time, first.camera->exposure_report().time);

  third.open();
  third.device->control("Exposure Time, Absolute").most = 50;  // less than it said
  third.camera->follow_exposure_of(*first.camera);
  first.run(1);
  third.run(5);
  EXPECT_EQ(exposure(third), 50);
  EXPECT_EQ(third.camera->exposure_report().changes, 1u) << "it is asked once";
}

TEST(V4l2Camera, AControlUnderWayWhenTheCameraIsLostIsSetAgain) {
  CameraRig rig;
  rig.open();
  rig.run(1);
  rig.kernel.side_ns = 2 * kSecond_ns;
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  rig.run(0.1);
  rig.device->dequeue_error = EIO;
  rig.run(1);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  ControlChange answer;
  EXPECT_FALSE(rig.camera->control_answer(answer)) << "still under way";
  rig.device->control("Brightness").value = 3;
  rig.run(4.5);
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_TRUE(answer.is_set);
  EXPECT_FALSE(rig.camera->control_answer(answer)) << "answered once";
  EXPECT_EQ(rig.device->control("Brightness").value, 250);
  rig.camera->close();
  EXPECT_EQ(rig.kernel.open_files(), 0u);
}

TEST(V4l2Camera, ClosedWithAControlUnderWayLeavesNothingBehind) {
  CameraRig rig;
  rig.open();
  rig.kernel.side_ns = kSecond_ns;
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  rig.run(0.1);
  rig.camera->close();
  EXPECT_EQ(rig.kernel.open_files(), 0u);
  rig.run(0);
}

}  // namespace
}  // namespace epiline
