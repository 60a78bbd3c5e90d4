// Stamps of a camera that cannot be. Against a made-up camera, in its own time.
#include <gtest/gtest.h>

#include "drivers/sensors/camera/v4l2_camera.h"
#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

using test::CameraRig;
using test::FakeCamera;
using test::kMs;
using test::kSecond_ns;

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
    rig.open(2);
    rig.device->change_image = [&](FakeCamera::Image& image) { image.stamp_ns += step_ns; };
    EXPECT_NEAR(static_cast<double>(rig.run(3)), 86, 1);
    EXPECT_EQ(rig.camera->counts().bad_stamps, 4u);
    EXPECT_NEAR(static_cast<double>((rig.last.stamp - rig.last.arrival).ns), static_cast<double>(step_ns), 2e6);
  }
}

TEST(V4l2Camera, AStuckStampIsNeverBelieved) {
  CameraRig rig;
  rig.settings.trust_stamps = true;
  rig.open(2);
  const std::int64_t stuck_ns = rig.kernel.clock_ns + 100 * kSecond_ns;
  rig.device->change_image = [&](FakeCamera::Image& image) { image.stamp_ns = stuck_ns; };
  EXPECT_EQ(rig.run(3), 0u);
}

TEST(V4l2Camera, ANewStreamBeginsWithoutTheStampsOfTheOneBefore) {
  CameraRig rig;
  rig.settings.trust_stamps = true;
  rig.open(2);
  rig.device->dequeue_error = EIO;
  rig.device->change_image = [](FakeCamera::Image& image) { image.stamp_ns -= 3'600 * kSecond_ns; };
  EXPECT_NEAR(static_cast<double>(rig.run(2)), 59, 2);
  EXPECT_EQ(rig.camera->counts().bad_stamps, 0u);
}

TEST(V4l2Camera, AnImageOfBeforeTheStreamIsLeftOut) {
  for (const bool trusts : {false, true}) {
    SCOPED_TRACE(trusts ? "trusted" : "monotonic");
    CameraRig rig;
    rig.settings.trust_stamps = trusts;
    rig.device->driver = "v4l2 loopback";
    rig.device->keeps_image = true;
    std::uint64_t taken = 0;
    rig.device->change_image = [&](FakeCamera::Image& /*image*/) { ++taken; };
    rig.open();
    const HostStamp begun{rig.kernel.clock_ns};
    rig.run(2);
    EXPECT_GT(rig.first.stamp, begun);
    EXPECT_EQ(rig.camera->counts().frames, taken);
    rig.device->dequeue_error = EIO;
    rig.run(2);
    EXPECT_EQ(rig.camera->counts().disconnected, 1u);
    EXPECT_EQ(rig.camera->counts().frames, taken);
    EXPECT_EQ(rig.camera->counts().bad_stamps + rig.camera->counts().lost, 0u) << "nothing is missing";
  }
}

}  // namespace
}  // namespace epiline
