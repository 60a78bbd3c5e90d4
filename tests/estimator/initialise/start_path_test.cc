#include "estimator/initialise/start_path.h"

#include <gtest/gtest.h>

#include "tests/estimator/initialise/start_flight.h"

namespace epiline::test {
namespace {

TEST(StartPath, FollowsTheTruePath) {
  StartFlight f = fly(wandering(3), {.imu_per_interval = 200});
  StartPath path;
  chain(f.problem, f.truth.b_g, f.truth.b_a, path);
  for (int k = 0; k < f.problem.frames; ++k) {
    EXPECT_NEAR((path[k].position(f.truth) - f.p[k]).norm(), 0, 1e-6) << "frame " << k;
    EXPECT_NEAR(so3_log(path[k].R.transpose() * f.R[k]).norm(), 0, 1e-6) << "frame " << k;
  }
}

TEST(StartPath, DerivativesAreThoseOfThePath) {
  StartFlight f = fly(wandering(4), {});
  constexpr double h = 1e-5;
  const StartState x = f.truth;
  StartPath path;
  chain(f.problem, x.b_g, x.b_a, path);
  for (int d = 0; d < kStartDof; ++d) {
    StartVector step = StartVector::Zero();
    step[d] = h;
    const StartState up = moved(x, step), down = moved(x, -step);
    StartPath a, b;
    chain(f.problem, up.b_g, up.b_a, a);
    chain(f.problem, down.b_g, down.b_a, b);
    for (int k = 0; k < f.problem.frames; ++k) {
      const Vec3 dp = (a[k].position(up) - b[k].position(down)) / (2 * h);
      StartRows turning = StartRows::Zero();
      turning.middleCols<3>(5) = path[k].rotation_rows();
      const Vec3 dphi = so3_log(a[k].R * b[k].R.transpose()) / (2 * h);
      EXPECT_NEAR((dp - path[k].position_rows(x.g_0).col(d)).norm(), 0, 1e-6) << "frame " << k << " column " << d;
      EXPECT_NEAR((dphi - turning.col(d)).norm(), 0, 1e-6) << "frame " << k << " column " << d;
    }
  }
}

TEST(StartPath, GravityKeepsItsLength) {
  StartState x;
  StartVector d = StartVector::Zero();
  d[3] = 0.4;
  d[4] = -0.3;
  EXPECT_NEAR(moved(x, d).g_0.norm(), kGravity, 1e-12);
}

}  // namespace
}  // namespace epiline::test
