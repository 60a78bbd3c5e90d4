// The flight controller's heights over the link.
#include <gtest/gtest.h>

#include "tests/drivers/links/mavlink/fake_line.h"

namespace epiline::mavlink {
namespace {

/// A link that wants heights, and a flight controller that answers its questions of time.
class HeightLink : public testing::Test, protected LinkOnALine {
 protected:
  void begin(const std::array<bool, kHeightKinds>& kinds) {
    link.want_heights(kinds, 15);
    LinkOnALine::begin();
    line.answer_timesync();
    line.peer.heartbeat();
    ASSERT_TRUE(wait_for([&] { return link.clock_state().used >= 20; }));
    HeightSample none;
    EXPECT_EQ(link.read_height(none, Span{}), ReadOutcome::kTimeout);
  }
  ScaledPressure pressure(float hpa) const {
    return {.time_boot_ms = static_cast<std::uint32_t>(line.now_ns() / kMs), .press_abs = hpa};
  }
  std::vector<int> asked_for() const {
    std::vector<int> messages;
    for (const CommandLong& command : sent<CommandLong>()) {
      if (command.command == 511) messages.push_back(static_cast<int>(command.param1));
    }
    return messages;
  }
};

TEST_F(HeightLink, HandsOnHeightsAndAsksForWhatDoesNotCome) {
  begin({true, true});
  ASSERT_TRUE(wait_for([&] { return asked_for().size() >= 3; }));
  EXPECT_EQ(asked_for()[0], 29);
  EXPECT_EQ(asked_for()[1], 132);
  EXPECT_EQ(asked_for()[2], 141);
  line.peer.send(pressure(1001.29F));
  advance(5 * kMs);
  HeightSample sample;
  ASSERT_EQ(link.read_height(sample, Span{}), ReadOutcome::kSample);
  EXPECT_NEAR(sample.metres, 100, 0.3);
  EXPECT_EQ(link.state().heights.heights, 1u);
  line.peer.send(pressure(1000), Address{1, 50});
  advance(5 * kMs);
  EXPECT_EQ(link.read_height(sample, Span{}), ReadOutcome::kTimeout) << "of no autopilot";
  EXPECT_EQ(link.counts().strangers, 1u);
}

TEST_F(HeightLink, AsksForNothingThatIsNotWanted) {
  begin({false, true});
  ASSERT_TRUE(wait_for([&] { return asked_for().size() >= 2; }));
  for (const int message : asked_for()) EXPECT_EQ(message, 132);
}

TEST(MavlinkLinkWithoutHeights, IgnoresThem) {
  LinkOnALine rig;
  rig.begin();
  rig.line.peer.heartbeat();
  rig.line.peer.send(ScaledPressure{.time_boot_ms = 5, .press_abs = 1000});
  ASSERT_TRUE(rig.wait_for([&] { return rig.link.counts().packets >= 2; }));
  HeightSample sample;
  EXPECT_EQ(rig.link.read_height(sample, Span{}), ReadOutcome::kTimeout);
  for (const CommandLong& command : rig.sent<CommandLong>()) EXPECT_NE(command.command, 511);
}

}  // namespace
}  // namespace epiline::mavlink
