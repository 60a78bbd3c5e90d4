#include "drivers/links/mavlink/pilot_news.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <set>
#include <string>

namespace epiline::mavlink {
namespace {

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

// Ground stations show and speak texts by their MAV_SEVERITY.
TEST(MavlinkNews, TheEndOfOdometryIsCritical) {
  constexpr int kCritical = 2, kWarning = 4, kInfo = 6;
  EXPECT_EQ(pilot_text(Condition::kLost, 0, false).severity, kCritical);
  EXPECT_EQ(pilot_text(Condition::kSilent, 0, false).severity, kCritical);
  EXPECT_EQ(pilot_text(Condition::kDegraded, 0, false).severity, kWarning);
  EXPECT_EQ(pilot_text(Condition::kGood, 0, false).severity, kInfo);
  EXPECT_EQ(pilot_text(Condition::kWaiting, 0, false).severity, kInfo);
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
