// The value between four neighbours, on signals whose best interpolation is known: a smooth curve, a vibration close to
// half the sampling rate, and noise.
#include "estimator/inertial/interpolator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace epiline::test {
namespace {

using Values = Interpolator::Values;

/// Root mean square error of the interpolator, once it has learnt, and of the line between the nearest two.
struct Errors {
  double learnt = 0, line = 0, usual = 0;
};

Errors errors_on(const std::function<double(int)>& signal) {
  Interpolator interpolator;
  Errors e;
  const int n = 4000, from = 2000;
  const auto at = [&](int i) { return Values::Constant(signal(i)); };
  for (int i = 2; i < n; ++i) {
    const Interpolator::Neighbours four{at(i - 2), at(i - 1), at(i + 1), at(i + 2)};
    if (i >= from) {
      e.learnt += std::pow(interpolator.between(four)[4] - signal(i), 2) / (n - from);
      e.line += std::pow(0.5 * (signal(i - 1) + signal(i + 1)) - signal(i), 2) / (n - from);
    }
    interpolator.learn(four, at(i));
  }
  return {std::sqrt(e.learnt), std::sqrt(e.line), interpolator.usual_error()[4]};
}

TEST(Interpolator, FollowsASmoothCurve) {
  const Errors e = errors_on([](int i) { return 3 * std::sin(0.2 * i); });
  EXPECT_LT(e.learnt, 0.2 * e.line);
}

/// 83 Hz at 200 readings a second: the neighbours lie on the other side of the mean.
TEST(Interpolator, FollowsAVibrationNearHalfTheRate) {
  const Errors e = errors_on([](int i) { return 1.5 * std::sin(2 * M_PI * 83 / 200. * i) + 9.8; });
  EXPECT_LT(e.learnt, 0.2 * e.line);
}

TEST(Interpolator, TakesTheMeanOfNoise) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, 0.5);
  std::vector<double> noise(4010);
  for (double& x : noise) x = normal(random);
  const Errors e = errors_on([&](int i) { return noise[static_cast<std::size_t>(i)]; });
  EXPECT_NEAR(e.learnt, 0.5 * std::sqrt(1.25), 0.03);
  EXPECT_NEAR(e.line, 0.5 * std::sqrt(1.5), 0.03);
  EXPECT_NEAR(e.usual, std::sqrt(2 / M_PI) * e.learnt, 0.1);
}

TEST(Interpolator, AnImpactTeachesLittle) {
  const auto calm = [](int i) { return 0.1 * std::sin(0.2 * i); };
  const Errors without = errors_on(calm), with = errors_on([&](int i) { return calm(i) + (i == 1990 ? 500 : 0); });
  EXPECT_LT(with.learnt, 3 * without.learnt);
}

}  // namespace
}  // namespace epiline::test
