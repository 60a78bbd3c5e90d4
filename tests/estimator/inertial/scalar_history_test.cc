#include "estimator/inertial/scalar_history.h"

#include <gtest/gtest.h>

#include <limits>

namespace epiline::test {
namespace {

constexpr Span kLongest = Span::from_milliseconds(250);

constexpr HostStamp at_ms(std::int64_t ms) { return HostStamp{ms * 1'000'000}; }

TEST(ScalarHistory, LiesOnTheLineBetweenItsNeighbours) {
  ScalarHistory history(kLongest);
  double value = -1;
  EXPECT_FALSE(history.at(at_ms(0), value));
  EXPECT_TRUE(history.push(at_ms(1'000), 1));
  EXPECT_TRUE(history.at(at_ms(1'000), value));
  EXPECT_EQ(value, 1);
  EXPECT_FALSE(history.at(at_ms(1'001), value)) << "nothing after it yet";
  EXPECT_FALSE(history.at(at_ms(999), value)) << "nothing before it";
  EXPECT_TRUE(history.push(at_ms(1'020), 3));
  EXPECT_TRUE(history.at(at_ms(1'005), value));
  EXPECT_DOUBLE_EQ(value, 1.5);
  EXPECT_TRUE(history.push(at_ms(2'000), 5));
  EXPECT_FALSE(history.at(at_ms(1'500), value)) << "too long a gap";
  EXPECT_TRUE(history.at(at_ms(1'015), value));
  EXPECT_DOUBLE_EQ(value, 2.5);
}

TEST(ScalarHistory, RefusesWhatIsNoNumberOrNotLater) {
  ScalarHistory history(kLongest);
  EXPECT_FALSE(history.push(at_ms(1), std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(history.push(at_ms(1), std::numeric_limits<double>::infinity()));
  EXPECT_TRUE(history.push(at_ms(10), 1));
  EXPECT_FALSE(history.push(at_ms(10), 2));
  EXPECT_FALSE(history.push(at_ms(9), 2));
  for (int i = 1; i < 1'000; ++i) EXPECT_TRUE(history.push(at_ms(10 + 10 * i), i));
  double value = 0;
  EXPECT_TRUE(history.at(at_ms(9'005), value));
  EXPECT_NEAR(value, 899.5, 1e-9);
  EXPECT_FALSE(history.at(at_ms(1'000), value)) << "forgotten";
}

}  // namespace
}  // namespace epiline::test
