// Controls of a camera, also slow ones. Against a made-up camera, in its own time.
#include <gtest/gtest.h>

#include "drivers/sensors/camera/v4l2_camera.h"
#include "tests/drivers/sensors/camera/camera_rig.h"

namespace epiline {
namespace {

using test::CameraRig;
using test::kSecond_ns;

TEST(V4l2Camera, ControlsAreSetWhileItStreamsAndAgainWhenItIsBack) {
  CameraRig rig;
  rig.open(0.1);
  EXPECT_FALSE(rig.camera->request_control(std::string(60, 'x'), 1));
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  ASSERT_TRUE(rig.camera->request_control("no_such_control", 1));
  ASSERT_TRUE(rig.camera->request_control("exposure_time_absolute", 1'000));  // 255 is all it takes
  rig.run(0.2);
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

// A USB camera that does not answer a control transfer holds its caller for 5 s.
TEST(V4l2Camera, ASlowControlCostsNoImage) {
  CameraRig rig;
  rig.open(1);
  rig.device->control_ns = rig.kernel.side_ns = 5 * kSecond_ns;
  const std::size_t files = rig.kernel.open_files();
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  EXPECT_NEAR(static_cast<double>(rig.run(6)), 180, 1);
  EXPECT_EQ(rig.camera->counts().lost, 0u);
  EXPECT_EQ(rig.kernel.open_files(), files) << "the transfer's own are closed";
  ControlChange answer;
  ASSERT_TRUE(rig.camera->control_answer(answer));
  EXPECT_TRUE(answer.is_set);
  EXPECT_EQ(rig.device->control("Brightness").value, 250);
}

void control_exposure(CameraRig& rig, bool automatic) {
  rig.settings.exposure_control = "exposure_time_absolute";
  rig.settings.exposure = Span{100'000};
  rig.settings.control_of_exposure.automatic = automatic;
  rig.settings.control_of_exposure.longest_ms = 20;
  rig.settings.control_of_exposure.brightness = 200;  // the made-up camera's images are darker
}

TEST(V4l2Camera, ASlowChangeOfExposureCostsNoImage) {
  CameraRig rig;
  control_exposure(rig, true);
  rig.open();
  rig.device->control_ns = rig.kernel.side_ns = 2 * kSecond_ns;
  EXPECT_NEAR(static_cast<double>(rig.run(10)), 300, 1);
  EXPECT_EQ(rig.camera->counts().lost, 0u);
  const std::uint64_t changes = rig.camera->exposure_report().changes;
  EXPECT_GE(changes, 2u);
  EXPECT_LE(changes, 5u) << "one at a time, each seen before the next";
  EXPECT_GT(rig.device->control("Exposure Time, Absolute").value, 40);
}

TEST(V4l2Camera, ASecondCameraIsExposedAsTheFirst) {
  CameraRig first, second, third;
  for (CameraRig* rig : {&first, &second, &third}) control_exposure(*rig, rig == &first);
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
  rig.open(1);
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
}

TEST(V4l2Camera, ClosedWithAControlUnderWayLeavesNothingBehind) {
  CameraRig rig;
  rig.open();
  rig.kernel.side_ns = kSecond_ns;
  ASSERT_TRUE(rig.camera->request_control("brightness", 250));
  rig.run(0.1);
  rig.run(0);
}

/// Refuses each call, for one reason after the other.
class BusyFile final : public test::FakeFile {
 public:
  int ioctl(unsigned long /*request*/, void* /*argument*/) override { return test::refuse(reasons.at(calls++)); }

  std::vector<int> reasons{EINTR, EINTR, EAGAIN, EBUSY};
  std::size_t calls = 0;
};

TEST(CallDevice, BeginsAgainAfterASignalAlone) {
  test::FakeKernel kernel;
  const auto file = std::make_shared<BusyFile>();
  const int fd = kernel.give(file);
  EXPECT_EQ(call_device(kernel, fd, VIDIOC_DQBUF, nullptr), EAGAIN);
  EXPECT_EQ(file->calls, 3u);
  EXPECT_EQ(call_device(kernel, fd, VIDIOC_STREAMON, nullptr), EBUSY);
  EXPECT_EQ(file->calls, 4u);
}

}  // namespace
}  // namespace epiline
