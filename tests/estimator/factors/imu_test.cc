// Its gradient: gradient_test.cc. Derivation: docs/derivations/imu.md.
#include "estimator/factors/imu.h"

#include <gtest/gtest.h>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/inertial/random_interval.h"

namespace epiline::test {
namespace {

const ImuNoise kNoise{};

Vec15 residual(const Preintegration& interval, const NavState& i, const NavState& j) {
  ImuResidual out;
  evaluate_imu(interval, {}, i, j, out);
  return out.r;
}

// A body that turns at a constant rate and accelerates constantly in W.
TEST(ImuFactor, VanishesOnAClosedFormTrajectory) {
  const Vec3 w(0.4, -1.2, 0.7), acceleration_W(1, -2, 0.5);
  NavState i;
  i.p = {1, 2, 3};
  i.v = {-1, 0.5, 2};
  i.R = so3_exp(Vec3(0.3, -2, 1));
  i.b_a = {0.1, -0.2, 0.05};
  i.b_g = {0.01, 0.08, -0.03};
  NavState j = i;
  const double T = 0.5, dt = 0.005;
  j.p = i.p + T * i.v + 0.5 * T * T * acceleration_W;
  j.v = i.v + T * acceleration_W;
  j.R = i.R * so3_exp(T * w);
  Preintegration interval;
  interval.reset(i.b_a, i.b_g);
  const auto specific_force = [&](int k) -> Vec3 {
    return (i.R * so3_exp(k * dt * w)).transpose() * (acceleration_W - kGravity_W) + i.b_a;
  };
  for (int k = 0; k < 100; ++k)
    interval.integrate(w + i.b_g, specific_force(k), w + i.b_g, specific_force(k + 1), dt, kNoise);
  EXPECT_LT(residual(interval, i, j).norm(), 1e-12);
}

TEST(ImuFactor, SquareRootInformationInvertsTheCovariance) {
  Random random(3);
  const Readings s = agile_readings(21, 0.005, random);
  const Preintegration interval = integrated(s, Vec3::Zero(), Vec3::Zero(), kNoise);
  Mat15 L_inverse;
  ASSERT_TRUE(square_root_information(interval, L_inverse));
  for (int i = 0; i < 15; ++i)
    for (int j = i + 1; j < 15; ++j) EXPECT_EQ(L_inverse(i, j), 0) << i << ", " << j;
  EXPECT_LT(relative_difference(congruence(interval.C, L_inverse.transpose()), Mat15::Identity()), 3e-5);
}

TEST(ImuFactor, SquareRootInformationExistsAfterASingleStepAndIsRefusedWithoutAny) {
  Preintegration interval;
  Mat15 L_inverse;
  EXPECT_FALSE(square_root_information(interval, L_inverse));
  const Vec3 w(0.1, 0.2, 0.3), a(0, 0, 9.81);
  interval.integrate(w, a, w, a, 0.005, kNoise);
  ASSERT_TRUE(square_root_information(interval, L_inverse));
  EXPECT_TRUE(L_inverse.allFinite());
}

}  // namespace
}  // namespace epiline::test
