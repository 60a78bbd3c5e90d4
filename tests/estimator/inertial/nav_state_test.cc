// The tangent of a state.
#include "estimator/inertial/nav_state.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "tests/estimator/inertial/random_interval.h"

namespace epiline::test {
namespace {

RC_GTEST_PROP(NavState, LocalUndoesRetract, (std::uint32_t seed)) {
  Random random(seed);
  const NavState x = random_state(random);
  Vec6 pose;
  Vec9 rest;
  pose << random.gaussian(3), random.uniform(0, 3.1) * random.gaussian(1).normalized();
  rest << random.gaussian(2), random.gaussian(0.1), random.gaussian(0.1);
  NavState y = x;
  retract_pose(y, pose);
  retract_velocity_biases(y, rest);
  RC_ASSERT((local_pose(x, y) - pose).norm() < 1e-12 * (1 + pose.norm() / (3.15 - pose.tail<3>().norm())));
  RC_ASSERT((local_velocity_biases(x, y) - rest).norm() < 1e-14 * (1 + x.v.norm() + rest.norm()));
}

/// On the right: what the body calls its first axis.
TEST(NavState, RotationIsPerturbedInTheBody) {
  NavState x;
  x.R = so3_exp(Vec3(0, 0, M_PI / 2));
  Vec6 d = Vec6::Zero();
  d[3] = 0.1;
  NavState y = x;
  retract_pose(y, d);
  EXPECT_LT((y.R - so3_exp(Vec3(0, 0.1, 0)) * x.R).norm(), 1e-15) << "the body's first axis is the world's second";
}

}  // namespace
}  // namespace epiline::test
