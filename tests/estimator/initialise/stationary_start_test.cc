#include "estimator/initialise/stationary_start.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.h"
#include "estimator/initialise/start_problem.h"

namespace epiline::test {
namespace {

ImuStatistics readings(const Vec3& force, const Vec3& rate, double duration_s) {
  ImuStatistics r;
  r.count = 100;
  r.duration_s = duration_s;
  r.mean_specific_force = force;
  r.mean_rate = rate;
  return r;
}

TEST(StationaryStart, LevelsEveryAttitude) {
  for (const Vec3& turn :
       {Vec3(0, 0, 0), Vec3(0.3, -0.2, 1), Vec3(0, 1.5707963, 0), Vec3(0, -1.5707963, 0), Vec3(3.1, 0, 0)}) {
    const Mat3 R_WB = so3_exp(turn);
    ImuStatistics rest = readings(R_WB.transpose() * Vec3(0, 0, kGravity), Vec3(0.01, -0.02, 0.08), 0.5);
    InitialState x;
    ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
    EXPECT_NEAR((x.R_WB * rest.mean_specific_force - Vec3(0, 0, kGravity)).norm(), 0, 1e-9);
    EXPECT_NEAR((x.R_WB * x.R_WB.transpose() - Mat3::Identity()).norm(), 0, 1e-12);
    EXPECT_GT(x.R_WB.determinant(), 0);
    EXPECT_EQ(x.b_g, rest.mean_rate);
    EXPECT_EQ(x.v_WB, Vec3(0, 0, 0));
  }
}

TEST(StationaryStart, HasNoYaw) {
  const ImuStatistics rest =
      readings(so3_exp(Vec3(0.3, -0.2, 1)).transpose() * Vec3(0, 0, kGravity), Vec3::Zero(), 0.5);
  InitialState x;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_NEAR(std::atan2(x.R_WB(1, 0), x.R_WB(0, 0)), 0, 1e-12);
}

/// However the body is mounted: with its x axis upright, a tilt of half a degree turns that axis' own heading by
/// anything.
TEST(HeadingFrom, IsTheTurnAboutTheVerticalWhateverAxisIsUpright) {
  const Mat3 mounts[] = {Mat3::Identity(), so3_exp(Vec3(0, -1.5707963, 0)), so3_exp(Vec3(1.5707963, 0, 0))};
  for (const Mat3& mount : mounts) {
    for (const double turn : {0.0, 0.7, -3.0}) {
      const Mat3 reference = so3_exp(Vec3(0.01, -0.005, 0.4)) * mount;
      EXPECT_NEAR(heading_from(so3_exp(Vec3(0, 0, -turn)) * reference, reference), turn, 1e-12);
      const Mat3 tilted = so3_exp(Vec3(0, 0, -turn)) * so3_exp(Vec3(-0.009, 0.009, 0)) * reference;
      EXPECT_NEAR(std::remainder(heading_from(tilted, reference) - turn, 2 * M_PI), 0, 1e-3);
    }
  }
}

TEST(StationaryStart, TiltIsKnownAsWellAsTheAccelerometer) {
  ImuStatistics rest = readings(Vec3(0, 0, kGravity), Vec3::Zero(), 0.5);
  InitialState x;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_NEAR(x.sigma_tilt, 0.1 / 9.81, 1e-3);
  EXPECT_DOUBLE_EQ(x.sigma_b_a, 0.1);
  const double half_second = x.sigma_b_g;
  rest.duration_s = 0.001;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_GT(x.sigma_b_g, half_second);
}

/// Readings that shake leave more of their mean.
TEST(StationaryStart, TiltIsKnownLessWhereItShakes) {
  ImuStatistics rest = readings(Vec3(0, 0, kGravity), Vec3::Zero(), 0.5);
  rest.sigma_specific_force = 3;
  InitialState x;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_NEAR(x.sigma_tilt, std::hypot(0.1, 3 / std::sqrt(100)) / 9.81, 1e-3);
}

/// The biases of a standing vehicle explain its readings; an error of its attitude is in the accelerometer's, too.
TEST(StationaryStart, FindsTheBiasesOfAStandingVehicle) {
  const Mat3 R_WB = so3_exp(Vec3(0.1, -0.2, 0.7));
  const Vec3 b_a(0.3, -0.1, 0.2), b_g(0.02, -0.05, 0.01);
  const ImuStatistics rest = readings(R_WB.transpose() * Vec3(0, 0, kGravity) + b_a, b_g, 0.5);
  const RestBiases found = biases_at_rest(rest, {}, R_WB);
  EXPECT_LT((found.b_a - b_a).norm(), 1e-9);
  EXPECT_LT((found.b_g - b_g).norm(), 1e-9);
  StateCovariance P = StateCovariance::Zero();
  P.diagonal().segment<3>(3) = Vec3(1e-4, 2e-4, 3e-4);
  const StateCovariance C = covariance_at_rest(found, R_WB, P);
  for (int axis = 0; axis < 3; ++axis) {
    constexpr double h = 1e-6;
    const Vec3 moved = biases_at_rest(rest, {}, R_WB * so3_exp(h * Vec3::Unit(axis))).b_a - found.b_a;
    EXPECT_LT((C.block<3, 1>(9, 3 + axis) - P(3 + axis, 3 + axis) * moved / h).norm(), 1e-8);
  }
}

TEST(StationaryStart, RefusesWhatIsNotRest) {
  InitialState x;
  EXPECT_EQ(solve_stationary_start(readings(Vec3(0, 0, 9.81), Vec3::Zero(), 0), {}, 0.1, x), StartRefusal::kNoImu);
  EXPECT_EQ(solve_stationary_start(readings(Vec3(0, 0, 8), Vec3::Zero(), 1), {}, 0.1, x),
            StartRefusal::kBiasImplausible);
  const Vec3 none(0, 0, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(solve_stationary_start(readings(none, Vec3::Zero(), 1), {}, 0.1, x), StartRefusal::kNoImu);
}

}  // namespace
}  // namespace epiline::test
