// docs/derivations/wheel.md
#include "estimator/inertial/wheel_way.h"

#include <gtest/gtest.h>

#include <cmath>

#include "estimator/geometry/so3.h"
#include "tests/estimator/made_up_time.h"

namespace epiline::test {
namespace {

constexpr double kSpeed = 2, kTurn = 0.4;

/// A circle about the left, with one speed every 20 ms.
struct Circle {
  Circle() {
    for (int i = 0; i < 500; ++i) imu.push({at(5e-3 * i), {0, 0, kTurn}, {0, kSpeed * kTurn, 9.81 + 1e-6 * i}});
    for (int i = 0; i < 100; ++i) speeds.push(at(20e-3 * i), kSpeed);
  }
  WheelWay way(double from_s, double to_s) const {
    WheelWay out;
    EXPECT_TRUE(integrate_way(speeds, imu, at(from_s), at(to_s), Vec3::UnitX(), Vec3::Zero(), {}, out));
    return out;
  }
  ImuHistory imu;
  ScalarHistory speeds{Span::from_milliseconds(250)};
};

TEST(WheelWay, FollowsTheTurn) {
  const Circle circle;
  const WheelWay way = circle.way(0.513, 1.111);
  const double angle = kTurn * 0.598, radius = kSpeed / kTurn;
  EXPECT_LT((way.way - Vec3(radius * std::sin(angle), radius * (1 - std::cos(angle)), 0)).norm(), 1e-4);
  EXPECT_LT((way.axis_s - way.way / kSpeed).norm(), 1e-9) << "a constant speed";
  EXPECT_NEAR(way.time_of_one_s2, 0.02 * 0.598, 1e-6);
}

TEST(WheelWay, JoinedIsAsIntegratedAtOnce) {
  const Circle circle;
  WheelWay joined = circle.way(0.513, 0.8);
  joined.join(so3_exp(Vec3(0, 0, kTurn * 0.287)), circle.way(0.8, 1.111));
  const WheelWay whole = circle.way(0.513, 1.111);
  EXPECT_LT((joined.way - whole.way).norm(), 1e-5);
  EXPECT_LT((joined.axis_s - whole.axis_s).norm(), 1e-5);
  EXPECT_NEAR(joined.time_of_one_s2, whole.time_of_one_s2, 1e-9);
}

TEST(WheelWay, NeedsSpeedsAroundAllOfIt) {
  const Circle circle;
  WheelWay out;
  const auto is_known = [&](double from_s, double to_s) {
    return integrate_way(circle.speeds, circle.imu, at(from_s), at(to_s), Vec3::UnitX(), Vec3::Zero(), {}, out);
  };
  EXPECT_FALSE(is_known(-0.1, 0.1));
  EXPECT_FALSE(is_known(1.9, 2.0));
  EXPECT_TRUE(is_known(0, 1.98));
}

TEST(WheelWay, OfTwoScalesSaysNothing) {
  const Circle circle;
  WheelWay joined = circle.way(0.5, 0.6);
  joined.slips = true;
  joined.join(Mat3::Identity(), circle.way(0.6, 0.7));
  EXPECT_FALSE(joined.known);
  EXPECT_TRUE(joined.mixed);
}

}  // namespace
}  // namespace epiline::test
