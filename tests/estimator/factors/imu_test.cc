// docs/derivations/imu.md
#include "estimator/factors/imu.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "tests/estimator/inertial/random_interval.h"

namespace epiline {
namespace {

using test::displaced;
using test::Random;
using test::random_state;
using Mat15x32 = Eigen::Matrix<double, 15, 32>;

const ImuNoise kNoise{};

Vec15 residual(const Preintegration& interval, const NavState& i, const NavState& j, const ImuScale& scale = {}) {
  ImuResidual out;
  evaluate_imu(interval, scale, i, j, out);
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

// Five-point differences of the residual, block by block, in whitened units.
RC_GTEST_PROP(ImuFactorProperty, JacobianEqualsNumericalDerivative, (std::uint32_t seed)) {
  Random random(seed);
  const test::Readings s = test::agile_readings(21, 0.005, random);
  const Preintegration interval = test::integrated(s, random.gaussian(0.1), random.gaussian(0.05), kNoise);
  const NavState i = random_state(random), j = random_state(random);
  const ImuScale scale{random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01)};
  ImuResidual at_ij;
  evaluate_imu(interval, scale, i, j, at_ij);
  RC_PRE(at_ij.r.segment<3>(3).norm() < 2.8);  // beyond, Log jumps within the differences
  Mat15 L_inverse;
  RC_ASSERT(square_root_information(interval, L_inverse));

  const double h = 1e-3;
  Mat15x32 numeric;
  for (int column = 0; column < 32; ++column) {
    const auto at = [&](double x) -> Vec15 {
      if (column == 30) return residual(interval, i, j, {scale.accelerometer + x, scale.gyroscope});
      if (column == 31) return residual(interval, i, j, {scale.accelerometer, scale.gyroscope + x});
      Vec15 d = Vec15::Zero();
      d(column % 15) = x;
      return column < 15 ? residual(interval, displaced(i, d), j, scale)
                         : residual(interval, i, displaced(j, d), scale);
    };
    numeric.col(column) = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h);
  }
  const Mat15x32 white = L_inverse * at_ij.J, white_numeric = L_inverse * numeric;
  for (int row = 0; row < 15; row += 3)
    for (int column = 0; column < 30; column += 3) {
      const Mat3 block = white.block<3, 3>(row, column), expected = white_numeric.block<3, 3>(row, column);
      RC_ASSERT((block - expected).norm() < 1e-7 * expected.norm() + 1e-4);
    }
  const auto by_scale = white.rightCols<2>(), expected = white_numeric.rightCols<2>();
  RC_ASSERT((by_scale - expected).norm() < 1e-7 * expected.norm());
}

RC_GTEST_PROP(ImuFactorProperty, PositionAndYawOfThePairAreUnobservable, (std::uint32_t seed)) {
  Random random(seed);
  const test::Readings s = test::agile_readings(21, 0.005, random);
  const Preintegration interval = test::integrated(s, Vec3::Zero(), Vec3::Zero(), kNoise);
  const NavState i = random_state(random), j = random_state(random);
  ImuResidual out;
  evaluate_imu(interval, {}, i, j, out);
  Eigen::Matrix<double, 30, 4> null = Eigen::Matrix<double, 30, 4>::Zero();
  for (int frame = 0; frame < 2; ++frame) {
    const NavState& x = frame == 0 ? i : j;
    const Vec3 z = Vec3::UnitZ();
    null.block<3, 3>(15 * frame, 0).setIdentity();
    null.block<3, 1>(15 * frame, 3) = z.cross(x.p);
    null.block<3, 1>(15 * frame + 3, 3) = x.R.transpose() * z;
    null.block<3, 1>(15 * frame + 6, 3) = z.cross(x.v);
  }
  RC_ASSERT((out.J.leftCols<30>() * null).norm() < 1e-12 * out.J.norm() * null.norm());
}

TEST(ImuFactor, SquareRootInformationInvertsTheCovariance) {
  Random random(3);
  const test::Readings s = test::agile_readings(21, 0.005, random);
  const Preintegration interval = test::integrated(s, Vec3::Zero(), Vec3::Zero(), kNoise);
  Mat15 L_inverse;
  ASSERT_TRUE(square_root_information(interval, L_inverse));
  EXPECT_EQ(Mat15(L_inverse.triangularView<Eigen::StrictlyUpper>()).norm(), 0);
  EXPECT_LT((L_inverse * interval.C * L_inverse.transpose() - Mat15::Identity()).norm(), 1e-4);
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
}  // namespace epiline
