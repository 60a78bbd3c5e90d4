// By how much images correct the IMU, against draws from a known covariance.
#include "estimator/monitor/evidence.h"

#include <gtest/gtest.h>

#include <random>

namespace epiline::test {
namespace {

TEST(Innovation, IsOneInTheMeanSquareForErrorsAsTheCovarianceSays) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  StateCovariance P = StateCovariance::Zero();
  P.diagonal().segment<3>(3) = Vec3(1e-6, 1e-6, 1e-6);
  P.diagonal().segment<3>(6) = Vec3(4e-4, 1e-4, 9e-4);
  NavState predicted;
  predicted.R = so3_exp(Vec3(0.3, -0.2, 1));
  predicted.v = Vec3(3, -1, 0.5);
  const auto draw = [&](int at) {
    Vec3 d;
    for (int i = 0; i < 3; ++i) d[i] = std::sqrt(P(at + i, at + i)) * normal(random);
    return d;
  };
  double velocity = 0, attitude = 0;
  constexpr int kDraws = 4000;
  for (int i = 0; i < kDraws; ++i) {
    NavState solved = predicted;
    solved.v += draw(6);
    velocity += std::pow(innovation(predicted, P, solved), 2) / kDraws;
    solved = predicted;
    solved.R = predicted.R * so3_exp(draw(3));
    attitude += std::pow(innovation(predicted, P, solved), 2) / kDraws;
  }
  EXPECT_NEAR(velocity, 1, 0.06);
  EXPECT_NEAR(attitude, 1, 0.06);
}

TEST(Innovation, ACorrectionOfWhatWasCertainIsEndless) {
  NavState solved;
  solved.v.x() = 1e-3;
  EXPECT_GT(innovation(NavState{}, StateCovariance::Zero(), solved), 1e12);
}

}  // namespace
}  // namespace epiline::test
