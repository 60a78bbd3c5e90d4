#include "drivers/links/stream/odometry_gate.h"

#include <gtest/gtest.h>

#include <cstdint>

namespace epiline {
namespace {

Odometry odometry(std::int64_t stamp_ms, HealthState state = HealthState::kTracking, std::uint32_t resets = 0) {
  Odometry o;
  o.stamp = HostStamp{stamp_ms * 1'000'000};
  o.health.state = state;
  o.reset_counter = resets;
  return o;
}

TEST(OdometryGates, AdmitsWhatIsNewAndTracked) {
  OdometryGate gate(7);
  EXPECT_FALSE(gate.admits(odometry(1, HealthState::kInitialising)));
  EXPECT_TRUE(gate.admits(odometry(2)));
  EXPECT_TRUE(gate.admits(odometry(3, HealthState::kDegraded)));
  EXPECT_EQ(gate.reset_counter(), 7);
}

// The publisher hands out the last prediction again while a sensor is silent.
TEST(OdometryGates, NeverRepeatsAPose) {
  OdometryGate gate(0);
  EXPECT_TRUE(gate.admits(odometry(5)));
  EXPECT_FALSE(gate.admits(odometry(5)));
  EXPECT_FALSE(gate.admits(odometry(4)));
  auto within_a_microsecond = odometry(5);
  within_a_microsecond.stamp.ns += 999;
  EXPECT_FALSE(gate.admits(within_a_microsecond));
  EXPECT_TRUE(gate.admits(odometry(6)));
}

TEST(OdometryGates, CountsJumpsOnce) {
  OdometryGate gate(255);
  EXPECT_TRUE(gate.admits(odometry(1, HealthState::kTracking, 4)));
  EXPECT_EQ(gate.reset_counter(), 255);  // the first has nothing to jump from
  EXPECT_TRUE(gate.admits(odometry(2, HealthState::kTracking, 5)));
  EXPECT_EQ(gate.reset_counter(), 0);
  EXPECT_TRUE(gate.admits(odometry(3, HealthState::kTracking, 5)));
  EXPECT_EQ(gate.reset_counter(), 0);
}

TEST(OdometryGates, ResumingIsAJump) {
  OdometryGate gate(10);
  EXPECT_FALSE(gate.admits(odometry(1, HealthState::kInitialising)));
  EXPECT_TRUE(gate.admits(odometry(2)));
  EXPECT_EQ(gate.reset_counter(), 10);  // there was nothing before
  EXPECT_FALSE(gate.admits(odometry(3, HealthState::kLost)));
  EXPECT_FALSE(gate.admits(odometry(4, HealthState::kInitialising)));
  EXPECT_TRUE(gate.admits(odometry(5)));
  EXPECT_EQ(gate.reset_counter(), 11);
  EXPECT_FALSE(gate.admits(odometry(6, HealthState::kLost)));
  EXPECT_TRUE(gate.admits(odometry(7, HealthState::kTracking, 1)));
  EXPECT_EQ(gate.reset_counter(), 12);  // both reasons, one jump
}

// Nobody has handed out anything for a while: the next estimate is a jump, as after a loss.
TEST(OdometryGates, ResumingAfterSilenceIsAJump) {
  OdometryGate gate(10);
  gate.stop();
  EXPECT_TRUE(gate.admits(odometry(1)));
  EXPECT_EQ(gate.reset_counter(), 10);  // there was nothing before
  gate.stop();
  EXPECT_TRUE(gate.admits(odometry(2)));
  EXPECT_TRUE(gate.admits(odometry(3)));
  EXPECT_EQ(gate.reset_counter(), 11);
}

}  // namespace
}  // namespace epiline
