#include "drivers/links/stream/odometry_gate.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <set>
#include <string>

namespace epiline::mavlink {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

epiline::Odometry odometry(std::int64_t stamp_ms, HealthState state = HealthState::kTracking,
                           std::uint32_t resets = 0) {
  epiline::Odometry o;
  o.stamp = HostStamp{stamp_ms * 1'000'000};
  o.health.state = state;
  o.reset_counter = resets;
  return o;
}

TEST(MavlinkGate, AdmitsWhatIsNewAndTracked) {
  OdometryGate gate(7);
  EXPECT_FALSE(gate.admits(odometry(1, HealthState::kInitialising)));
  EXPECT_TRUE(gate.admits(odometry(2)));
  EXPECT_TRUE(gate.admits(odometry(3, HealthState::kDegraded)));
  EXPECT_EQ(gate.reset_counter(), 7);
}

// The publisher hands out the last prediction again while a sensor is silent.
TEST(MavlinkGate, NeverRepeatsAPose) {
  OdometryGate gate(0);
  EXPECT_TRUE(gate.admits(odometry(5)));
  EXPECT_FALSE(gate.admits(odometry(5)));
  EXPECT_FALSE(gate.admits(odometry(4)));
  auto within_a_microsecond = odometry(5);
  within_a_microsecond.stamp.ns += 999;
  EXPECT_FALSE(gate.admits(within_a_microsecond));
  EXPECT_TRUE(gate.admits(odometry(6)));
}

TEST(MavlinkGate, CountsJumpsOnce) {
  OdometryGate gate(255);
  EXPECT_TRUE(gate.admits(odometry(1, HealthState::kTracking, 4)));
  EXPECT_EQ(gate.reset_counter(), 255);  // the first has nothing to jump from
  EXPECT_TRUE(gate.admits(odometry(2, HealthState::kTracking, 5)));
  EXPECT_EQ(gate.reset_counter(), 0);
  EXPECT_TRUE(gate.admits(odometry(3, HealthState::kTracking, 5)));
  EXPECT_EQ(gate.reset_counter(), 0);
}

TEST(MavlinkGate, ResumingIsAJump) {
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
TEST(MavlinkGate, ResumingAfterSilenceIsAJump) {
  OdometryGate gate(10);
  gate.stop();
  EXPECT_TRUE(gate.admits(odometry(1)));
  EXPECT_EQ(gate.reset_counter(), 10);  // there was nothing before
  gate.stop();
  EXPECT_TRUE(gate.admits(odometry(2)));
  EXPECT_TRUE(gate.admits(odometry(3)));
  EXPECT_EQ(gate.reset_counter(), 11);
}

TEST(MavlinkNews, TextsFitAndNameTheReason) {
  std::set<std::string> texts;
  for (int reason = 0; reason < kHealthReasons; ++reason) {
    for (const Condition condition : {Condition::kDegraded, Condition::kLost}) {
      const PilotText text = pilot_text(condition, 1U << reason, false);
      EXPECT_LT(std::strlen(text.text), 50U) << text.text;  // full texts would have been cut
      texts.insert(text.text);
    }
  }
  EXPECT_GE(texts.size(), 36U);
  EXPECT_LT(std::strlen(pilot_text(Condition::kGood, 0, true).text), 50U);
  const auto both = bit(HealthReason::kCameraSilent) | bit(HealthReason::kFewTracks);
  EXPECT_STREQ(pilot_text(Condition::kLost, both, false).text, "VIO lost, stopped: no camera images");
}

std::string told(PilotNews& news, std::int64_t now_ns) {
  const auto text = news.take(now_ns);
  return text ? text->text : "";
}

TEST(MavlinkNews, TellsEachChangeOnce) {
  PilotNews news;
  news.update(0, Condition::kWaiting, 0);
  EXPECT_EQ(told(news, 0), "VIO starting, no position yet");
  EXPECT_EQ(news.due_ns(), std::numeric_limits<std::int64_t>::max());
  news.update(2 * kSecond, Condition::kGood, 0);
  EXPECT_EQ(told(news, 2 * kSecond), "");  // it has to last
  EXPECT_EQ(news.due_ns(), 5 * kSecond / 2);
  EXPECT_EQ(told(news, 3 * kSecond), "VIO ok");
  news.update(4 * kSecond, Condition::kLost, bit(HealthReason::kLensCovered));
  EXPECT_EQ(told(news, 4 * kSecond), "VIO lost, stopped: lens covered");
  EXPECT_EQ(told(news, 9 * kSecond), "");
  news.update(10 * kSecond, Condition::kGood, 0);
  EXPECT_EQ(told(news, 11 * kSecond), "VIO ok again, position was reset");
}

TEST(MavlinkNews, DoesNotChatter) {
  PilotNews news;
  int count = 0;
  for (int ms = 0; ms < 20'000; ms += 5) {
    const std::int64_t now_ns = ms * 1'000'000LL;
    news.update(now_ns, ms / 100 % 2 == 0 ? Condition::kGood : Condition::kDegraded, 0);
    if (news.take(now_ns)) ++count;
  }
  EXPECT_LE(count, 1);  // neither lasts
  for (int ms = 20'000; ms < 40'000; ms += 5) {
    const std::int64_t now_ns = ms * 1'000'000LL;
    news.update(now_ns, ms / 100 % 2 == 0 ? Condition::kGood : Condition::kLost, 0);
    if (news.take(now_ns)) ++count;
  }
  EXPECT_LE(count, 21);  // being lost is told at once, once a second at most
}

}  // namespace
}  // namespace epiline::mavlink
