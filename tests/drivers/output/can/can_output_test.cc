// What needs no bus. The rest is in tests/hardware/can_test.cc, against the kernel's vcan.
#include "drivers/output/can/can_output.h"

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

// The rate of a feed, by stamps: 200 readings per second, 40 wanted.
TEST(OdometryFeed, LetsThroughAsManyAsAreWantedAndEveryChange) {
  OdometryFeed feed(40);
  Odometry o;
  o.health.state = HealthState::kTracking;
  int let_through = 0;
  std::uint64_t last = 0;
  const auto offer = [&] {
    feed.offer(o);
    const Offer* const newest = feed.newest();
    if (newest == nullptr || newest->serial == last) return false;
    last = newest->serial;
    EXPECT_EQ(newest->odometry.stamp, o.stamp);
    return true;
  };
  o.stamp.ns = 1'000'000'000;
  for (int i = 0; i < 1'000; ++i) {
    let_through += offer() ? 1 : 0;
    o.stamp.ns += 5'000'000 + (i % 3 - 1) * 100'000;  // as real readings are
  }
  EXPECT_EQ(let_through, 200);
  o.stamp.ns += 1'000'000;
  while (!offer()) o.stamp.ns += 1'000'000;
  o.health.state = HealthState::kLost;
  EXPECT_TRUE(offer()) << "a change of state goes at once, with the same stamp";
  EXPECT_FALSE(offer());
  o.health.reasons = bit(HealthReason::kImuSilent);
  EXPECT_TRUE(offer());
  ++o.reset_counter;
  EXPECT_TRUE(offer());
  // a clock that went back, or far on, begins a new grid
  o.stamp.ns -= 900'000'000;
  EXPECT_TRUE(offer());
  EXPECT_FALSE(offer());
  o.stamp.ns += 100'000'000'000;
  EXPECT_TRUE(offer());
  EXPECT_FALSE(offer());
}

}  // namespace
}  // namespace epiline
