#include "platform/time/latency_bins.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

namespace epiline {
namespace {

TEST(LatencyBins, AgreeWithTheSortedValues) {
  std::mt19937 random(1);
  std::lognormal_distribution<double> latency_ms(0.2, 0.9);
  LatencyBins bins;
  std::vector<double> values;
  for (int i = 0; i < 20'000; ++i) {
    const auto ns = static_cast<std::int64_t>(1e6 * latency_ms(random));
    values.push_back(static_cast<double>(ns));
    bins.add(ns);
  }
  std::sort(values.begin(), values.end());
  EXPECT_EQ(bins.count(), values.size());
  const double median = values[10'000], p99 = values[19'800];
  EXPECT_NEAR(static_cast<double>(bins.quantile_ns(0.5)), median, 0.0625 * median);
  EXPECT_NEAR(static_cast<double>(bins.quantile_ns(0.99)), p99, 0.0625 * p99);
  EXPECT_EQ(static_cast<double>(bins.most_ns()), values.back());
}

TEST(LatencyBins, TakeEverything) {
  LatencyBins bins;
  EXPECT_EQ(bins.quantile_ns(0.99), 0);
  constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();
  for (const std::int64_t ns : {std::numeric_limits<std::int64_t>::min(), std::int64_t{0}, std::int64_t{15}, kLargest})
    bins.add(ns);
  EXPECT_EQ(bins.count(), 4u);
  EXPECT_EQ(bins.most_ns(), kLargest);
  EXPECT_EQ(bins.quantile_ns(0.5), 0);
  EXPECT_EQ(bins.quantile_ns(0.75), 15);
  EXPECT_EQ(bins.quantile_ns(1), kLargest);
}

}  // namespace
}  // namespace epiline
