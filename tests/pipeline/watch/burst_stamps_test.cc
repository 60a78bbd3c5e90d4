#include "pipeline/watch/burst_stamps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>

#include "tests/support/times.h"

namespace epiline {
namespace {

constexpr std::int64_t kUs = 1'000, kEven_ns = 5'000 * kUs;
constexpr int kPerSecond = 200;  // readings

/// A sensor whose readings wait for each other and are stamped when they arrive, one every so often.
struct Line {
  std::int64_t apart_ns = 0;
  std::int64_t late_most_ns = 0;
  std::int64_t delay_ns = 0;
  std::mt19937 random{5};

  /// Reading `i` of bursts of `n`.
  HostStamp stamp(int i, int n) {
    const int k = i % n;
    if (k == 0) delay_ns = late_most_ns > 0 ? static_cast<std::int64_t>(random() % late_most_ns) : 0;
    const std::int64_t last_ns = kStart_ns + (i - k + n - 1) * kEven_ns;
    return {last_ns + delay_ns - (n - 1 - k) * apart_ns};
  }
};

std::int64_t error_ns(HostStamp given, int i) { return std::abs(given.ns - (kStart_ns + i * kEven_ns)); }

TEST(BurstStamps, ReadingsOfABurstGetEvenSteps) {
  for (const std::int64_t apart_us : {0, 100, 1000}) {
    for (const int n : {2, 3, 4, 7, 20}) {
      Line line{apart_us * kUs};
      BurstStamps bursts;
      HostStamp last;
      std::int64_t worst_ns = 0;
      for (int i = 0; i < 20 * kPerSecond; ++i) {
        const HostStamp even = bursts.step(line.stamp(i, n));
        if (i > kPerSecond / 2) {
          ASSERT_GT(even, last) << n << " readings, " << apart_us << " us apart";
          worst_ns = std::max(worst_ns, error_ns(even, i));
        }
        last = even;
      }
      EXPECT_LT(worst_ns, kUs) << n << " readings, " << apart_us << " us apart";
      EXPECT_NEAR(bursts.per_burst(), n, 0.5);
    }
  }
}

TEST(BurstStamps, TheFastestBurstsTellTheTime) {
  Line line{50 * kUs, 2'000 * kUs};
  BurstStamps bursts;
  std::int64_t worst_ns = 0;
  for (int i = 0; i < 60 * kPerSecond; ++i) {
    const HostStamp even = bursts.step(line.stamp(i, 4));
    if (i > 2 * kPerSecond) worst_ns = std::max(worst_ns, error_ns(even, i));
  }
  EXPECT_LT(worst_ns, 1'000 * kUs);
}

TEST(BurstStamps, EvenAndJitteringStreamsAreLeftAlone) {
  std::mt19937 random(3);
  for (const std::int64_t jitter_us : {0, 500, 2400}) {
    BurstStamps bursts;
    for (int i = 0; i < 60 * kPerSecond; ++i) {
      const std::int64_t jitter_ns =
          std::uniform_int_distribution<std::int64_t>(-jitter_us * kUs, jitter_us * kUs)(random);
      const HostStamp stamp{kStart_ns + i * kEven_ns + jitter_ns};
      ASSERT_EQ(bursts.step(stamp), stamp) << jitter_us;
    }
  }
}

TEST(BurstStamps, AMissingReadingIsNoticed) {
  Line line{1'000 * kUs};
  BurstStamps bursts;
  for (int i = 0; i < 20 * kPerSecond; ++i) {
    if (i == 10 * kPerSecond) continue;
    const HostStamp even = bursts.step(line.stamp(i, 3));
    if (i > kPerSecond && std::abs(i - 10 * kPerSecond) > kPerSecond) {
      ASSERT_LT(error_ns(even, i), 50 * kUs) << i;
    }
  }
}

TEST(BurstStamps, AfterASilenceItLearnsAnew) {
  Line line{1'000 * kUs};
  BurstStamps bursts;
  for (int i = 0; i < 20 * kPerSecond; ++i) {
    if (i > 10 * kPerSecond && i < 12 * kPerSecond) continue;
    const HostStamp even = bursts.step(line.stamp(i, 3));
    if (i > kPerSecond && (i < 10 * kPerSecond || i > 13 * kPerSecond)) {
      ASSERT_LT(error_ns(even, i), kUs) << i;
    }
  }
}

}  // namespace
}  // namespace epiline
