#include "platform/time/interval_tracker.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

constexpr std::int64_t kMs = 1'000'000;

TEST(IntervalTracker, CountsMissingSamples) {
  IntervalTracker interval;
  EXPECT_EQ(interval.usual_ns(), 0);
  EXPECT_EQ(interval.note(5 * kMs), 0u);
  EXPECT_EQ(interval.usual_ns(), 5e6);
  for (int i = 0; i < 100; ++i) interval.note((i % 2 == 0 ? 4 : 6) * kMs);
  EXPECT_NEAR(interval.usual_ns(), 5e6, 0.3e6);
  IntervalTracker even(5e6);
  EXPECT_EQ(even.note(7 * kMs), 0u) << "late";
  EXPECT_EQ(even.note(10 * kMs), 1u);
  EXPECT_EQ(even.note(50 * kMs), 9u);
  EXPECT_NEAR(even.usual_ns(), 5e6, 0.2e6) << "a gap is no new rate";
}

// Not one sample in time, eight times in a row: the device has been set to another rate. And again.
TEST(IntervalTracker, FollowsARateThatHalvesTwice) {
  IntervalTracker interval(5e6);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(interval.note(10 * kMs), 1u);
  EXPECT_EQ(interval.usual_ns(), 10e6);
  for (int i = 0; i < 7; ++i) {
    EXPECT_EQ(interval.note(20 * kMs), 1u);
    EXPECT_EQ(interval.usual_ns(), 10e6);
  }
  EXPECT_EQ(interval.note(21 * kMs), 1u);
  EXPECT_EQ(interval.usual_ns(), 20e6) << "the least of them: the others may have lost one";
  EXPECT_EQ(interval.note(20 * kMs), 0u);
}

TEST(IntervalTracker, OneSampleInTimeKeepsTheRate) {
  IntervalTracker interval(5e6);
  for (int round = 0; round < 5; ++round) {
    for (int i = 0; i < 7; ++i) EXPECT_EQ(interval.note(10 * kMs), 1u);
    EXPECT_EQ(interval.note(static_cast<std::int64_t>(interval.usual_ns())), 0u);
  }
  EXPECT_NEAR(interval.usual_ns(), 5e6, 0.6e6);
}

}  // namespace
}  // namespace epiline
