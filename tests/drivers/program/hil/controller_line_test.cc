// The lines that the controller's model listens on. Flights over them: hil_command_test.cc.
#include "drivers/program/hil/controller_line.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <algorithm>
#include <array>

#include "tests/drivers/program/program.h"

namespace epiline::hil {
namespace {

TEST(ControllerLine, APtyHasTheNameItIsGiven) {
  fs::create_directories(scratch());
  const fs::path name = scratch() / "controller";
  fs::create_symlink("/dev/pts/4711", name);  // left behind by somebody who was killed
  {
    const auto line = ControllerLine::open_pty(name);
    ASSERT_TRUE(line) << line.error().text();
    EXPECT_EQ((*line)->companion_end(), name.string());
    const auto wire = ControllerLine::open_serial(name, 57'600);
    ASSERT_TRUE(wire) << wire.error().text();
    const std::array<std::uint8_t, 3> bytes{1, '\r', 3};  // as they are
    (*wire)->write(bytes);
    pollfd ready{(*line)->fd(), POLLIN, 0};
    ::poll(&ready, 1, 10'000);
    std::array<std::uint8_t, 8> got{};
    EXPECT_EQ((*line)->read(got), bytes.size());
    EXPECT_TRUE(std::equal(bytes.begin(), bytes.end(), got.begin()));
  }
  EXPECT_FALSE(fs::is_symlink(name)) << "gone with the line";
  // What is somebody else's stays.
  fs::create_symlink("/dev/ttyACM0", name);
  const auto refused = ControllerLine::open_pty(name);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(fs::read_symlink(name), "/dev/ttyACM0");
  EXPECT_FALSE(ControllerLine::open_pty(scratch() / "no_folder" / "controller"));
  fs::remove_all(scratch());
}

TEST(ControllerLine, ASerialPortHasAWordForItsFaults) {
  EXPECT_EQ(ControllerLine::open_serial("/dev/null", 921'600).error().text(),
            "/dev/null: Inappropriate ioctl for device [TCGETS2]; expected a serial device that is wired to "
            "the configured one, or pty, udp or a CAN interface");
  EXPECT_FALSE(ControllerLine::open_serial("/dev/there_is_none", 921'600));
}

/// As live runs do: also those without a constant in the C library.
TEST(ControllerLine, ASerialPortTakesAnySpeed) {
  const auto line = ControllerLine::open_pty();
  ASSERT_TRUE(line) << line.error().text();
  for (const int baud : {57'600, 123'456, 250'000, 12'000'000}) {
    const auto wire = ControllerLine::open_serial((*line)->companion_end(), baud);
    EXPECT_TRUE(wire) << wire.error().text();
  }
}

}  // namespace
}  // namespace epiline::hil
