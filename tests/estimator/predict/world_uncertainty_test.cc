// What an unknown place and heading of the world add to a state's covariance, against worlds drawn at random.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/geometry/so3.h"
#include "estimator/predict/covariance.h"

namespace epiline::test {
namespace {

TEST(WorldUncertainty, MovesAllStatesOfTheWorldTogether) {
  NavState x;
  x.p = Vec3(2, -1, 0.5);
  x.v = Vec3(0.7, 1.2, -0.3);
  x.R = so3_exp(Vec3(0.4, -0.6, 1.1));
  const WorldUncertainty world{Vec3(-1, 0.5, 0.2), 0.5, 0.05};
  const StateCovariance added = covariance_added(world, x);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Eigen::Matrix<double, 9, 9> drawn = Eigen::Matrix<double, 9, 9>::Zero();
  constexpr int kDraws = 40'000;
  for (int n = 0; n < kDraws; ++n) {
    const Mat3 turn = so3_exp(Vec3(0, 0, world.sigma_yaw * normal(random)));
    const Vec3 shift = world.sigma_p * Vec3(normal(random), normal(random), normal(random));
    Eigen::Matrix<double, 9, 1> d;
    d << world.p + shift + turn * (x.p - world.p) - x.p, so3_log(x.R.transpose() * turn * x.R), turn * x.v - x.v;
    for (int i = 0; i < 9; ++i)
      for (int j = 0; j < 9; ++j) drawn(i, j) += d[i] * d[j] / kDraws;
  }
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j)
      EXPECT_NEAR(added(i, j), drawn(i, j), 0.05 * std::sqrt(drawn(i, i) * drawn(j, j)) + 1e-9) << i << ", " << j;
  EXPECT_EQ(added.rightCols<7>().norm(), 0) << "biases and the time offset know nothing of it";
}

TEST(WorldUncertainty, OfTheFirstWorldIsNone) { EXPECT_EQ(covariance_added({}, NavState{}).norm(), 0); }

}  // namespace
}  // namespace epiline::test
