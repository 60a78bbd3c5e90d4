#include "estimator/inertial/wheel_history.h"

#include <gtest/gtest.h>

#include <limits>

namespace epiline {
namespace {

// ---- speeds of the past ----

WheelSample sample(std::int64_t ms, double speed) { return {HostStamp{ms * 1'000'000}, speed, 0}; }
constexpr HostStamp at(std::int64_t ms) { return HostStamp{ms * 1'000'000}; }

TEST(WheelHistory, LiesOnTheLineBetweenItsNeighbours) {
  WheelHistory history;
  double speed = -1;
  EXPECT_FALSE(history.speed_at(at(0), speed));
  EXPECT_TRUE(history.push(sample(1'000, 1)));
  EXPECT_TRUE(history.speed_at(at(1'000), speed));
  EXPECT_EQ(speed, 1);
  EXPECT_FALSE(history.speed_at(at(1'001), speed)) << "nothing after it yet";
  EXPECT_FALSE(history.speed_at(at(999), speed)) << "nothing before it";
  EXPECT_TRUE(history.push(sample(1'020, 3)));
  EXPECT_TRUE(history.speed_at(at(1'005), speed));
  EXPECT_DOUBLE_EQ(speed, 1.5);
  EXPECT_TRUE(history.push(sample(2'000, 5)));
  EXPECT_FALSE(history.speed_at(at(1'500), speed)) << "too long a gap";
  EXPECT_TRUE(history.speed_at(at(1'015), speed));
  EXPECT_DOUBLE_EQ(speed, 2.5);
}

TEST(WheelHistory, RefusesWhatIsNoNumberOrNotLater) {
  WheelHistory history;
  EXPECT_FALSE(history.push(sample(1, std::numeric_limits<double>::quiet_NaN())));
  EXPECT_FALSE(history.push(sample(1, std::numeric_limits<double>::infinity())));
  EXPECT_TRUE(history.push(sample(10, 1)));
  EXPECT_FALSE(history.push(sample(10, 2)));
  EXPECT_FALSE(history.push(sample(9, 2)));
  for (int i = 1; i < 1'000; ++i) EXPECT_TRUE(history.push(sample(10 + 10 * i, i)));
  double speed = 0;
  EXPECT_TRUE(history.speed_at(at(9'005), speed));
  EXPECT_NEAR(speed, 899.5, 1e-9);
  EXPECT_FALSE(history.speed_at(at(1'000), speed)) << "forgotten";
}

}  // namespace
}  // namespace epiline
