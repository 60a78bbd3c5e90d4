#include "estimator/initialise/stationary_start.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.h"
#include "estimator/initialise/start_problem.h"

namespace epiline {
namespace {

TEST(StationaryStart, LevelsEveryAttitude) {
  for (const Vec3& turn :
       {Vec3(0, 0, 0), Vec3(0.3, -0.2, 1), Vec3(0, 1.5707963, 0), Vec3(0, -1.5707963, 0), Vec3(3.1, 0, 0)}) {
    const Mat3 R_WB = so3_exp(turn);
    RestReadings rest{R_WB.transpose() * Vec3(0, 0, kGravity), Vec3(0.01, -0.02, 0.08), 0.5};
    InitialState x;
    ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
    EXPECT_NEAR((x.R_WB * rest.specific_force - Vec3(0, 0, kGravity)).norm(), 0, 1e-9);
    EXPECT_NEAR((x.R_WB * x.R_WB.transpose() - Mat3::Identity()).norm(), 0, 1e-12);
    EXPECT_GT(x.R_WB.determinant(), 0);
    EXPECT_EQ(x.b_g, rest.rate);
    EXPECT_EQ(x.v_WB, Vec3(0, 0, 0));
  }
}

TEST(StationaryStart, HasNoYaw) {
  RestReadings rest{so3_exp(Vec3(0.3, -0.2, 1)).transpose() * Vec3(0, 0, kGravity), Vec3::Zero(), 0.5};
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
  RestReadings rest{Vec3(0, 0, kGravity), Vec3::Zero(), 0.5};
  InitialState x;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_NEAR(x.sigma_tilt, 0.1 / 9.81, 1e-3);
  EXPECT_DOUBLE_EQ(x.sigma_b_a, 0.1);
  const double half_second = x.sigma_b_g;
  rest.duration_s = 0.001;
  ASSERT_EQ(solve_stationary_start(rest, {}, 0.1, x), std::nullopt);
  EXPECT_GT(x.sigma_b_g, half_second);
}

TEST(StationaryStart, RefusesWhatIsNotRest) {
  InitialState x;
  EXPECT_EQ(solve_stationary_start({Vec3(0, 0, 9.81), Vec3::Zero(), 0}, {}, 0.1, x), StartRefusal::kNoImu);
  EXPECT_EQ(solve_stationary_start({Vec3(0, 0, 8), Vec3::Zero(), 1}, {}, 0.1, x), StartRefusal::kBiasImplausible);
  EXPECT_EQ(solve_stationary_start({Vec3(0, 0, std::numeric_limits<double>::quiet_NaN()), Vec3::Zero(), 1}, {}, 0.1, x),
            StartRefusal::kNoImu);
}

}  // namespace
}  // namespace epiline
