// Against a made-up camera, in its own time. tests/hardware has the kernel's drivers.
#include "drivers/sensors/camera/v4l2_camera.h"

#include <gtest/gtest.h>

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
  EXPECT_EQ(error_of({.device = "/dev/null", .buffers = 1}), "/dev/null: buffers = 1; expected 2 to 16");
}

// ---- a camera ----

using test::CameraRig;
using test::FakeCamera;
using test::kMs;

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
  EXPECT_EQ(rig.camera->counts().frames, count);
  EXPECT_EQ(rig.camera->counts().lost + rig.camera->counts().bad_stamps, 0u);
  EXPECT_FALSE(rig.camera->copies());
}

TEST(V4l2Camera, CopiesWhatIsNotGreyInPlace) {
  CameraRig rig;
  rig.device->formats[0].fourcc = V4L2_PIX_FMT_YUYV;
  rig.settings.formats = {PixelFormat::kGrey, PixelFormat::kYuyv};
  rig.open();
  EXPECT_TRUE(rig.camera->copies());
  EXPECT_NEAR(static_cast<double>(rig.run(1)), 30, 1);
  const int mappings = rig.kernel.mappings;
  EXPECT_GE(mappings, 2);
  rig.device->dequeue_error = EIO;
  EXPECT_NEAR(static_cast<double>(rig.run(1)), 29, 2);
  EXPECT_EQ(rig.camera->counts().disconnected, 1u);
  EXPECT_EQ(rig.kernel.mappings, mappings) << "those of the lost device are undone";
}

TEST(V4l2Camera, ImagesInMemoryThatIsSlowToReadAreCopiedOnce) {
  for (const bool exports : {true, false}) {
    CameraRig rig;
    rig.device->exports = exports;
    rig.reading_takes(Span::from_milliseconds(20), Span::from_milliseconds(1));
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
    rig.device->dequeue_error = EIO;
    EXPECT_NEAR(static_cast<double>(rig.run(1)), 29, 2) << "as before, when it was lost";
  }
}

// As the kernel's documents ask. One that is never ready holds up no image for long.
TEST(V4l2Camera, ReadingIsAnnouncedAgainWhereTheKernelSaysSo) {
  for (const auto& refusals : {std::vector<int>{EINTR, EAGAIN, EAGAIN, EINTR}, std::vector<int>(1'000'000, EAGAIN)}) {
    CameraRig rig;
    rig.device->sync_refusals = refusals;
    rig.reading_takes(Span::from_milliseconds(20), Span::from_milliseconds(1));
    rig.open();
    const std::size_t images = rig.run(1);
    EXPECT_NEAR(static_cast<double>(images), 30, 1);
    EXPECT_EQ(rig.device->readings, refusals.size() < 10 ? static_cast<int>(images) : 0);
  }
}

TEST(V4l2Camera, ImagesInMemoryThatIsFastEnoughAreLent) {
  CameraRig rig;
  rig.reading_takes(Span{190'000}, Span{100'000});
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
  rig.device->dequeue_error = EIO;
  EXPECT_GT(rig.run(1), 20u) << "after it was lost";
}

TEST(V4l2Camera, OfAMosaicComesHalfTheSize) {
  CameraRig rig;
  rig.device->formats = {{V4L2_PIX_FMT_SRGGB8, {{640, 360, {30}}, {1456, 1088, {30}}}}};
  rig.settings.formats = V4l2Settings().formats;
  rig.open();
  EXPECT_EQ(rig.camera->format().format, PixelFormat::kRggb8);
  EXPECT_EQ(rig.camera->format().width, 640);
  const std::size_t count = rig.run(1, [](const Frame& frame) {
    ASSERT_EQ(frame.width, 320);
    ASSERT_EQ(frame.height, 180);
    ASSERT_EQ(frame.data[0], 77);
  });
  EXPECT_NEAR(static_cast<double>(count), 30, 1);
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
    rig.open(1);
    // what was stamped in the middle of the made-up camera's life, to the middle row's middle
    const double to_middle_ms = driver == std::string("uvcvideo") ? -10 + 5 - 2 : 5 - 2;
    EXPECT_NEAR(1e-6 * static_cast<double>((rig.last.stamp - rig.last.arrival).ns), to_middle_ms, 1);
    rig.camera.reset();
    rig.settings.stamp_point = StampPoint::kStartOfExposure;
    rig.open(1);
    EXPECT_NEAR(1e-6 * static_cast<double>((rig.last.stamp - rig.last.arrival).ns), 2 + 5, 1) << "what is set wins";
  }
}

TEST(V4l2Camera, CountsWhatIsDamagedCutShortOrLost) {
  CameraRig rig;
  rig.open(1);
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

}  // namespace
}  // namespace epiline
