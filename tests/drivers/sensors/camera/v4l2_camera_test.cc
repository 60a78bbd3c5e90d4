// What needs no device. The rest is in tests/hardware, against the kernel's drivers.
#include "drivers/sensors/camera/v4l2_camera.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace epiline {
namespace {

std::string error_of(V4l2Settings settings) {
  V4l2Camera camera(std::move(settings));
  const Status status = camera.open();
  return status ? "opened" : status.error().text();
}

TEST(V4l2Camera, SaysWhatIsWrongWithTheDevice) {
  EXPECT_EQ(error_of({.device = "/dev/no-such-camera"}),
            "/dev/no-such-camera: open: No such file or directory; expected a device that is there (epiline check "
            "lists them)");
  EXPECT_EQ(error_of({.device = "/dev/null"}), "/dev/null: VIDIOC_QUERYCAP: not a V4L2 device; expected a V4L2 device");
  EXPECT_EQ(
      error_of({.device = "Wonder Cam"}),
      "/dev/video*: looking for the camera: none is called 'Wonder Cam'; expected the name or the bus of a camera");
  EXPECT_EQ(error_of({.device = "/dev/null", .buffers = 1}), "/dev/null: 1 buffers; expected 2 to 16");
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

}  // namespace
}  // namespace epiline
