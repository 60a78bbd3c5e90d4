#include "platform/math/statistics.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

// Expectations: numpy.quantile([1, 2, 4, 8, 16], q), and by hand.
TEST(Statistics, QuantilesLieBetweenNeighboursAsNumpysDo) {
  const std::vector<double> values = {1, 2, 4, 8, 16};
  EXPECT_DOUBLE_EQ(quantile(values, 0), 1);
  EXPECT_DOUBLE_EQ(quantile(values, 0.1), 1.4);
  EXPECT_DOUBLE_EQ(quantile(values, 0.5), 4);
  EXPECT_DOUBLE_EQ(quantile(values, 0.9), 12.8);
  EXPECT_DOUBLE_EQ(quantile(values, 1), 16);
  EXPECT_DOUBLE_EQ(quantile({7}, 0.99), 7);
}

TEST(Statistics, ASummaryDoesNotDependOnTheOrder) {
  const Summary s = summarise({16, 1, 8, 2, 4});
  EXPECT_EQ(s.count, 5u);
  EXPECT_DOUBLE_EQ(s.mean, 6.2);
  EXPECT_DOUBLE_EQ(s.rmse, 8.258329128825032);  // sqrt(341 / 5)
  EXPECT_DOUBLE_EQ(s.median, 4);
  EXPECT_DOUBLE_EQ(s.p90, 12.8);
  EXPECT_DOUBLE_EQ(s.p95, 14.4);
  EXPECT_DOUBLE_EQ(s.p99, 15.68);
  EXPECT_DOUBLE_EQ(s.p999, 15.968);
  EXPECT_DOUBLE_EQ(s.max, 16);
}

TEST(Statistics, OfSignedValuesTheMeanAndTheSizeDiffer) {
  const Summary s = summarise({-3, 3});
  EXPECT_DOUBLE_EQ(s.mean, 0);
  EXPECT_DOUBLE_EQ(s.rmse, 3);
  EXPECT_DOUBLE_EQ(s.median, 0);
}

TEST(Statistics, WithoutValuesEverythingIsZero) {
  const Summary s = summarise({});
  EXPECT_EQ(s.count, 0u);
  EXPECT_EQ(s.mean, 0);
  EXPECT_EQ(s.rmse, 0);
  EXPECT_EQ(s.max, 0);
}

}  // namespace
}  // namespace epiline
