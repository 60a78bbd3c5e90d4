// What needs no bus. The rest is in tests/hardware/can_test.cc, against the kernel's vcan.
#include "drivers/links/can/can_output.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace epiline {
namespace {

std::string error_of(const CanConfig& config) {
  CanOutput output(config, Mat3::Identity());
  const Status status = output.open();
  return status ? "opened" : status.error().text();
}

TEST(CanOutput, SaysWhatIsWrongWithTheSettings) {
  EXPECT_EQ(error_of({}), "[can]: no interface; expected can.interface, as `ip -br link` shows it");
  EXPECT_EQ(error_of({.interface = "can0", .base_id = 0x7fe}), "[can]: base_id 2046; expected 1 to 2037");
  EXPECT_EQ(error_of({.interface = "can0", .isotp_send_id = 0x305, .isotp_receive_id = 0x400}),
            "[can]: isotp_send_id 773, isotp_receive_id 1024; expected two different identifiers outside 768 to 778");
  EXPECT_NE(error_of({.interface = "can0", .isotp_send_id = 0x400}), "opened");
  EXPECT_NE(error_of({.interface = "can0", .isotp_send_id = 0x400, .isotp_receive_id = 0x400}), "opened");
}

// Kernels with CAN and without say different things; both in one line, with the interface and a remedy.
TEST(CanOutput, SaysThatThereIsNoSuchBusAndLeavesNothingBehind) {
  const auto open_files = [] {
    int count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
    return count;
  };
  const int before = open_files();
  const std::string error = error_of({.interface = "nosuchcan"});
  EXPECT_EQ(error.rfind("nosuchcan: ", 0), 0u) << error;
  EXPECT_NE(error.find("; expected "), std::string::npos) << error;
  EXPECT_EQ(open_files(), before);
}

}  // namespace
}  // namespace epiline
