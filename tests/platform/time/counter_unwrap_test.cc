// Derivation: docs/derivations/clock_sync.md
#include "platform/time/counter_unwrap.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

#include "tests/platform/time/clock_fixture.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

TEST(CounterUnwrap, TicksThatAreNoWholeNanosecondsAddUp) {
  CounterUnwrap<24> unwrap({78'125, 2});  // 39.0625 us, 655 s a turn
  EXPECT_EQ(unwrap.unwrap(0xfffffe, HostStamp{0}).ns, 0xfffffeLL * 78'125 / 2);
  EXPECT_EQ(unwrap.unwrap(0xffffff, HostStamp{39'062}).ns, 0xffffffLL * 78'125 / 2);
  EXPECT_EQ(unwrap.unwrap(0, HostStamp{78'125}).ns, 0x1000000LL * 78'125 / 2);
  EXPECT_EQ(unwrap.unwrap(0xab000001, HostStamp{117'187}).ns, 0x1000001LL * 78'125 / 2) << "higher bits are ignored";
}

TEST(CounterUnwrap, GapsOfManyTurnsAreBridged) {
  CounterUnwrap<16> unwrap({1000, 1});  // 65.536 ms a turn
  ASSERT_EQ(unwrap.unwrap(100, HostStamp{5 * kSecond}).ns, 100'000);
  EXPECT_EQ(unwrap.unwrap((100 + 10'000'000) & 0xffff, HostStamp{15 * kSecond}).ns, 100'000 + 10 * kSecond);
}

TEST(CounterUnwrap, ABurstAfterAStallKeepsItsTimes) {
  CounterUnwrap<16> unwrap({1000, 1});
  unwrap.unwrap(1000, HostStamp{0});
  // 45 ms of samples come at once: the nearest turn to the time of arrival would be the next one for the first of them
  for (std::int64_t us = 2000; us <= 46'000; us += 1000)
    EXPECT_EQ(unwrap.unwrap(static_cast<std::uint64_t>(us), HostStamp{45'000'000}).ns, us * 1000);
}

// Everything at once, against the counter that never wraps.
RC_GTEST_PROP(CounterUnwrap, FollowsTheTrueCounter, ()) {
  constexpr std::int64_t kTurn = 1 << 16;
  const TrueClock clock = any_clock();
  std::mt19937 random = any_random();
  std::uniform_real_distribution<double> uniform(0, 1);
  CounterUnwrap<16> unwrap({1000, 1});
  const std::int64_t begin = *rc::gen::inRange<std::int64_t>(0, kTurn);
  std::vector<std::int64_t> counts{begin};
  for (int i = 0; i < 2000; ++i) {
    const double kind = uniform(random);
    const double step = kind < 0.01 ? 300.0 * kTurn : kind < 0.1 ? 3.0 * kTurn : kTurn / 20.0;
    counts.push_back(counts.back() + static_cast<std::int64_t>(step * uniform(random)));
    if (kind > 0.95) counts.push_back(counts[counts.size() - 1 - counts.size() % 2]);  // twice
    if (kind > 0.9) std::swap(counts.back(), counts[counts.size() - 2]);               // out of order
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    // the first one has the least delay; at the latest after the gaps above another one is as good
    const double delay = i == 0 ? 0 : (i % 3 == 0 ? 0.02 : 0.7) * kTurn * 1000 * uniform(random);
    const HostStamp arrival = clock.host_of({counts[i] * 1000}) + Span{static_cast<std::int64_t>(delay)};
    RC_ASSERT(unwrap.unwrap(static_cast<std::uint64_t>(counts[i]), arrival).ns == counts[i] * 1000);
  }
}

}  // namespace
}  // namespace epiline
