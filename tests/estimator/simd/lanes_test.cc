// The vectors that the kernels compute with, of the width every processor of the kind has; that the wider ones do the
// same is seen in the factors (tests/estimator/factors/visual_test.cc).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>

#define TARGET kernels_baseline
#define LANES 2
#include "estimator/simd/lanes.inc"

namespace epiline::TARGET {
namespace {

double log_of_one(double x) { return log_of(all(x))[0]; }

RC_GTEST_PROP(Lanes, LogarithmIsThatOfTheLibrary, ()) {
  const int exponent = *rc::gen::inRange(-1020, 1020);
  const double mantissa = 1 + *rc::gen::inRange(0, 1 << 30) / double{1 << 30};
  const double x = std::ldexp(mantissa, exponent), expected = std::log(x);
  RC_ASSERT(std::abs(log_of_one(x) - expected) <= 4e-16 * std::max(1.0, std::abs(expected)));
}

TEST(Lanes, LogarithmIsExactToTheLastBitsNearOne) {
  EXPECT_EQ(log_of_one(1), 0);
  for (const double e : {1e-3, 1e-6, 1e-9, 1e-12, -1e-3, -1e-6, -1e-9})
    EXPECT_NEAR(log_of_one(1 + e) / std::log(1 + e), 1, 1e-15) << e;
  EXPECT_NEAR(log_of_one(std::numeric_limits<double>::max()), std::log(std::numeric_limits<double>::max()), 1e-12);
  EXPECT_NEAR(log_of_one(std::numeric_limits<double>::min()), std::log(std::numeric_limits<double>::min()), 1e-12);
}

TEST(Lanes, SumsGivesEachVectorItsOwnLane) {
  V v[LANES];
  for (int i = 0; i < LANES; ++i)
    for (int lane = 0; lane < LANES; ++lane) v[i][lane] = 100 * i + lane;
  const V total = sums(v);
  for (int i = 0; i < LANES; ++i) EXPECT_EQ(total[i], 100 * i * LANES + LANES * (LANES - 1) / 2) << "vector " << i;
}

}  // namespace
}  // namespace epiline::TARGET
