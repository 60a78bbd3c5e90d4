#include "drivers/links/mavlink/timesync.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace epiline::mavlink {
namespace {

constexpr Address kOwn{1, 197}, kAutopilot{1, 1};

TEST(MavlinkTimesync, AnswersQuestionsInTheirOrderWithOurClock) {
  TimesyncExchange exchange(kOwn);
  for (const std::int64_t ts1 : {11, -22, 33, 44})
    exchange.receive({.tc1 = 0, .ts1 = ts1}, {1, static_cast<std::uint8_t>(std::abs(ts1))}, false, kSecond);
  for (const std::int64_t ts1 : {11, -22, 33, 44}) {
    ASSERT_TRUE(exchange.owes_answer());
    const auto answer = exchange.answer(kSecond + 3);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->ts1, ts1);
    EXPECT_EQ(answer->tc1, kSecond + 3);
    EXPECT_EQ(answer->target_system, 1);
    EXPECT_EQ(answer->target_component, std::abs(ts1));
  }
  EXPECT_FALSE(exchange.owes_answer());
  EXPECT_FALSE(exchange.answer(kSecond + 4));
}

TEST(MavlinkTimesync, LeavesQuestionsToOthersAlone) {
  TimesyncExchange exchange(kOwn);
  exchange.receive({.tc1 = 0, .ts1 = 1, .target_system = 1, .target_component = 100}, kAutopilot, true, kSecond);
  exchange.receive({.tc1 = 0, .ts1 = 1, .target_system = 9}, kAutopilot, true, kSecond);
  EXPECT_FALSE(exchange.owes_answer());
}

TEST(MavlinkTimesync, AFloodIsAnsweredSlowly) {
  TimesyncExchange exchange(kOwn);
  int answers = 0;
  for (std::int64_t i = 0; i < 100'000; ++i) {  // ten seconds
    const std::int64_t now_ns = kSecond + i * kMs / 10;
    exchange.receive({.tc1 = 0, .ts1 = i}, kAutopilot, true, now_ns);
    if (exchange.answer(now_ns)) ++answers;
  }
  EXPECT_LE(answers, 1011);
  EXPECT_GE(answers, 990);
  EXPECT_EQ(exchange.refused_questions(), 100'000U - static_cast<unsigned>(answers));
}

/// An exchange of 2 ms with a clock `ahead_ns` of ours.
void ask(TimesyncExchange& exchange, std::int64_t now_ns, std::int64_t ahead_ns) {
  const Timesync question = exchange.question(kAutopilot, now_ns);
  exchange.receive({.tc1 = now_ns + kMs + ahead_ns, .ts1 = question.ts1}, kAutopilot, true, now_ns + 2 * kMs);
}

TEST(MavlinkTimesync, LearnsTheOtherClock) {
  TimesyncExchange exchange(kOwn);
  for (int i = 0; i < 100; ++i) ask(exchange, kSecond + i * 100 * kMs, -300 * kSecond);
  EXPECT_EQ(exchange.clock().state().status, ClockStatus::kLocked);
  EXPECT_NEAR(static_cast<double>(exchange.clock().state().offset.ns), 300e9, 1e3);
}

// Whatever comes unasked, from somebody else, again, or late: no clock is learnt from it.
TEST(MavlinkTimesync, IsNotMovedByWhatItDidNotAsk) {
  TimesyncExchange exchange(kOwn);
  for (int i = 0; i < 20; ++i) ask(exchange, kSecond + i * 100 * kMs, 5 * kSecond);
  const ClockState before = exchange.clock().state();
  const std::int64_t now_ns = 10 * kSecond;
  const Timesync question = exchange.question(kAutopilot, now_ns);
  exchange.receive({.tc1 = 99 * kSecond, .ts1 = 0}, kAutopilot, true, now_ns);           // never asked, though 0
  exchange.receive({.tc1 = 99 * kSecond, .ts1 = now_ns - 1}, kAutopilot, true, now_ns);  // nearly
  exchange.receive({.tc1 = 99 * kSecond, .ts1 = question.ts1}, {1, 42}, false, now_ns);  // somebody else
  exchange.receive({.tc1 = 99 * kSecond, .ts1 = kSecond}, kAutopilot, true, now_ns);     // answered long ago
  EXPECT_EQ(exchange.refused_answers(), 4U);
  EXPECT_EQ(exchange.clock().state().samples, before.samples);
  exchange.receive({.tc1 = now_ns + 5 * kSecond, .ts1 = question.ts1}, kAutopilot, true, now_ns + kMs);
  exchange.receive({.tc1 = now_ns + 6 * kSecond, .ts1 = question.ts1}, kAutopilot, true, now_ns + kMs);  // replayed
  EXPECT_EQ(exchange.clock().state().samples, before.samples + 1);
  EXPECT_EQ(exchange.refused_answers(), 5U);
}

// One absurd answer to a real question is an outlier, not a jump.
TEST(MavlinkTimesync, OneAbsurdAnswerMovesNothing) {
  TimesyncExchange exchange(kOwn);
  for (int i = 0; i < 20; ++i) ask(exchange, kSecond + i * 100 * kMs, 5 * kSecond);
  for (const std::int64_t absurd : {std::int64_t{1}, std::int64_t{-1}, std::numeric_limits<std::int64_t>::max(),
                                    std::numeric_limits<std::int64_t>::min(), 77 * kSecond}) {
    const std::int64_t now_ns = 4 * kSecond;
    const Timesync question = exchange.question(kAutopilot, now_ns);
    exchange.receive({.tc1 = absurd, .ts1 = question.ts1}, kAutopilot, true, now_ns + kMs);
    EXPECT_EQ(exchange.clock().state().jumps, 0U);
    EXPECT_NEAR(static_cast<double>(exchange.clock().state().offset.ns), -5e9, 1e3);
  }
}

}  // namespace
}  // namespace epiline::mavlink
