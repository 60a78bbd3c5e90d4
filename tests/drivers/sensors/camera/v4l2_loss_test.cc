// A camera that errs, is silent, is lost or comes back. Against a made-up camera, in its own time.
#include <gtest/gtest.h>

#include "drivers/sensors/camera/v4l2_camera.h"
#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

using test::CameraRig;
using test::FakeCamera;
using test::kMs;
using test::kSecond_ns;

TEST(V4l2Camera, AnErrorOfTheDeviceIsOvercomeAtOnce) {
  for (const bool at_dequeue : {true, false}) {
    CameraRig rig;
    rig.open(1);
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
  }
}

TEST(V4l2Camera, AStreamThatBreaksOffSilentlyIsOvercomeAtOnce) {
  CameraRig rig;
  rig.open(1);
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
  rig.open(1);
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
}

TEST(V4l2Camera, ASilentCameraIsOpenedAgain) {
  CameraRig rig;
  rig.open(1);
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
  }
}

TEST(V4l2Camera, AFailedAttemptToReopenIsRepeated) {
  CameraRig rig;
  rig.open(1);
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
  for (const bool copies : {false, true}) {
    CameraRig rig;
    rig.device->formats[0].fourcc = copies ? V4L2_PIX_FMT_YUYV : V4L2_PIX_FMT_GREY;
    rig.settings.formats = {PixelFormat::kGrey, PixelFormat::kYuyv};
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
    EXPECT_EQ(rig.camera->counts().no_slot > 0, copies);
  }
}

TEST(V4l2Camera, AnotherCameraIsNotTakenForTheOneThatWasLost) {
  for (const auto& [card, bus] :
       {std::pair{"Other Cam", "usb-0000:00:14.0-1"}, std::pair{"Made-up Cam", "usb-0000:00:14.0-2"}}) {
    SCOPED_TRACE(std::string(card) + ", " + bus);
    CameraRig rig;
    rig.open(1);
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
  rig.open(1);
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
  rig.open(1);
  rig.unplug(rig.settings.device);
  rig.run(1);
  rig.device->bus = "usb-0000:00:14.0-7";
  rig.plug_in(rig.settings.device);
  EXPECT_GT(rig.run(2), 20u);
  EXPECT_EQ(rig.camera->counts().other_camera, 0u);
}

}  // namespace
}  // namespace epiline
