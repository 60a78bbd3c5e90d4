// docs/derivations/wheel.md
#include "estimator/factors/wheel.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>

#include "estimator/geometry/so3.h"
#include "tests/estimator/inertial/random_interval.h"

namespace epiline {
namespace {

using test::displaced;
using test::Random;
using test::random_state;

WheelModel random_wheel(Random& random) {
  WheelModel wheel;
  wheel.forward_B = random.gaussian(1).normalized();
  wheel.p_BV = random.gaussian(0.5);
  return wheel;
}
WheelResidual residual(const WheelModel& wheel, double speed, const Vec3& omega, const NavState& x) {
  WheelResidual out;
  evaluate_wheel(wheel, speed, omega, x, x, out);
  return out;
}

// The IMU sits 0.4 m ahead of the rear axle and 0.3 m to its left, turned by a quarter: its y axis points ahead. The
// vehicle drives a circle of 5 m, its axle's middle at 2 m/s; so the IMU itself is faster than that, and askew.
TEST(WheelFactor, VanishesOnACircle) {
  WheelModel wheel;
  wheel.forward_B = Vec3(0, 1, 0);
  const Vec3 imu_in_vehicle(0.4, 0.3, 0);
  Mat3 R_BV;  // columns: the vehicle's forward, left, up in the IMU's axes
  R_BV << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  wheel.p_BV = R_BV * -imu_in_vehicle;
  const double speed = 2, turn = speed / 5, heading = 0.7;
  const Mat3 R_WV = so3_exp(Vec3(0, 0, heading));
  const Vec3 omega(0, 0, turn);
  NavState x;
  x.R = R_WV * R_BV.transpose();
  x.v = R_WV * (Vec3(speed, 0, 0) + omega.cross(imu_in_vehicle));
  x.b_g = Vec3(0.01, -0.02, 0.03);
  EXPECT_NEAR(residual(wheel, speed, omega + x.b_g, x).r, 0, 1e-12);
  EXPECT_NEAR(residual(wheel, speed - 0.1, omega + x.b_g, x).r, 0.1, 1e-12);
  EXPECT_GT(x.v.norm() - speed, -0.2);
  EXPECT_GT(std::abs(residual(WheelModel{.forward_B = wheel.forward_B}, speed, omega + x.b_g, x).r), 0.1)
      << "the lever matters here";
}

RC_GTEST_PROP(WheelFactor, JacobianEqualsNumericalDerivative, (std::uint32_t seed)) {
  Random random(seed);
  const WheelModel wheel = random_wheel(random);
  const NavState x = random_state(random);
  const Vec3 omega = random.gaussian(1);
  const WheelResidual at = residual(wheel, 1.3, omega, x);
  constexpr double h = 1e-3;
  for (int column = 0; column < 15; ++column) {
    const auto r = [&](double by) { return residual(wheel, 1.3, omega, displaced(x, by * Vec15::Unit(column))).r; };
    const double numeric = (8 * (r(h) - r(-h)) - (r(2 * h) - r(-2 * h))) / (12 * h);
    RC_ASSERT(std::abs(at.J[column] - numeric) < 1e-9 * (1 + std::abs(numeric)));
  }
}

// The solver steps along -weight r J, and tries the cost.
RC_GTEST_PROP(WheelFactor, TheWeightIsTheSlopeOfTheCost, (std::uint32_t seed)) {
  Random random(seed);
  const WheelModel wheel = random_wheel(random);
  const NavState x = random_state(random);
  const Vec3 omega = random.gaussian(1);
  const double speed = residual(wheel, 0, omega, x).r, off = 0.3 * random.gaussian(1).x(), h = 1e-5;
  const auto cost = [&](double r) { return residual(wheel, speed - r, omega, x).cost; };
  const WheelResidual at = residual(wheel, speed - off, omega, x);
  const double slope = (cost(off + h) - cost(off - h)) / (2 * h);
  RC_ASSERT(std::abs(2 * at.weight * at.r - slope) < 1e-6 * (1 + std::abs(slope)));
  RC_ASSERT(std::abs(residual(wheel, speed, omega, x).cost) < 1e-18);
}

TEST(WheelFactor, AWheelThatSlipsSaysLittle) {
  NavState x;
  x.v = Vec3(1, 0, 0);
  const WheelModel wheel;
  const WheelResidual good = residual(wheel, 1.05, Vec3::Zero(), x), slips = residual(wheel, 3, Vec3::Zero(), x);
  EXPECT_NEAR(good.weight, 400 / 1.25, 1e-9);
  EXPECT_LT(slips.weight * std::abs(slips.r), good.weight * std::abs(good.r));
}

// With first estimates anywhere, position and heading stay unobservable.
RC_GTEST_PROP(WheelFactor, FirstEstimatesKeepPositionAndYawUnobservable, (std::uint32_t seed)) {
  Random random(seed);
  const WheelModel wheel = random_wheel(random);
  const NavState x = random_state(random), l = random_state(random);
  WheelResidual out;
  evaluate_wheel(wheel, 1, random.gaussian(1), x, l, out);
  const Vec3 z = Vec3::UnitZ();
  Vec15 yaw = Vec15::Zero();
  yaw.head<3>() = z.cross(l.p);
  yaw.segment<3>(3) = l.R.transpose() * z;
  yaw.segment<3>(6) = z.cross(l.v);
  RC_ASSERT(std::abs(out.J * yaw) < 1e-12 * (1 + yaw.norm()));
  RC_ASSERT(out.J.head<3>().norm() == 0);
}

}  // namespace
}  // namespace epiline
