#include "drivers/flights/motion/random.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace epiline {
namespace {

TEST(RandomTest, IsTheSameEverywhere) {
  // from the definitions of SplitMix64's finaliser, MT19937-64 and Box-Muller, worked out with another program
  Random random(7, 2);
  EXPECT_EQ(random.uniform(), 0.7885553054008769);
  EXPECT_EQ(random.uniform(), 0.24328856262018417);
  EXPECT_NEAR(random.normal(), -0.24786142205112205, 1e-14);
  EXPECT_NEAR(random.normal(), -1.3767399220596883, 1e-14);
}

TEST(RandomTest, SeedsAndStreamsDiffer) {
  EXPECT_NE(Random(1, 0).uniform(), Random(2, 0).uniform());
  EXPECT_NE(Random(1, 0).uniform(), Random(1, 1).uniform());
  EXPECT_NE(Random(1, 0).uniform(), Random(0, 1).uniform());
}

TEST(RandomTest, NormalsHaveTheMomentsOfANormal) {
  Random random(3, 0);
  constexpr int kDraws = 400'000;
  double moments[4] = {}, neighbours = 0, tail = 0, last = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.normal();
    double power = x;
    for (double& m : moments) {
      m += power / kDraws;
      power *= x;
    }
    neighbours += x * last / kDraws;
    tail += (std::abs(x) > 3) / static_cast<double>(kDraws);
    last = x;
  }
  // five standard deviations of each estimate
  const double s = 5 / std::sqrt(kDraws);
  EXPECT_NEAR(moments[0], 0, s);
  EXPECT_NEAR(moments[1], 1, s * std::sqrt(2));
  EXPECT_NEAR(moments[2], 0, s * std::sqrt(15));
  EXPECT_NEAR(moments[3], 3, s * std::sqrt(96));
  EXPECT_NEAR(neighbours, 0, s);
  EXPECT_NEAR(tail, 0.0027, s * std::sqrt(0.0027));
}

TEST(RandomTest, UniformsFillTheirRange) {
  Random random(4, 0);
  double low = 1, high = 0, mean = 0;
  int chances = 0;
  constexpr int kDraws = 100'000;
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.uniform();
    low = std::min(low, u);
    high = std::max(high, u);
    mean += u / kDraws;
    chances += random.chance(0.3);
  }
  EXPECT_GE(low, 0);
  EXPECT_LT(high, 1);
  EXPECT_LT(low, 1e-3);
  EXPECT_GT(high, 1 - 1e-3);
  EXPECT_NEAR(mean, 0.5, 5 * 0.2887 / std::sqrt(kDraws));
  EXPECT_NEAR(chances / static_cast<double>(kDraws), 0.3, 5 * 0.458 / std::sqrt(kDraws));
}

}  // namespace
}  // namespace epiline
