#include "drivers/flights/motion/random.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(RandomTest, IsTheSameEverywhere) {
  // from the definitions of SplitMix64's finaliser, MT19937-64 and Box-Muller, worked out with another program
  Random random(7, 2);
  EXPECT_EQ(random.uniform(), 0.7885553054008769);
  EXPECT_EQ(random.uniform(), 0.24328856262018417);
  EXPECT_NEAR(random.normal(), -0.24786142205112205, 1e-14);
  EXPECT_NEAR(random.normal(), -1.3767399220596883, 1e-14);
  EXPECT_EQ(Random(7, 2).uniform(2, 4), 2 + 2 * 0.7885553054008769);
  EXPECT_TRUE(Random(7, 2).chance(0.79));
  EXPECT_FALSE(Random(7, 2).chance(0.78));
}

TEST(RandomTest, SeedsAndStreamsDiffer) {
  EXPECT_NE(Random(1, 0).uniform(), Random(2, 0).uniform());
  EXPECT_NE(Random(1, 0).uniform(), Random(1, 1).uniform());
  EXPECT_NE(Random(1, 0).uniform(), Random(0, 1).uniform());
}

}  // namespace
}  // namespace epiline
