// docs/derivations/consistency.md
#include "drivers/study/evaluate/calibration_curve.h"

#include <gtest/gtest.h>

#include <limits>

namespace epiline {
namespace {

TEST(ChiSquare, AgreesWithPrintedTables) {
  constexpr double kProbabilities[] = {0.1, 0.5, 0.9, 0.95, 0.99};
  constexpr double kQuantiles[3][5] = {{0.0157908, 0.4549364, 2.7055435, 3.8414588, 6.6348966},
                                       {0.2107210, 1.3862944, 4.6051702, 5.9914645, 9.2103404},
                                       {0.5843744, 2.3659739, 6.2513886, 7.8147279, 11.3448667}};
  for (int n = 1; n <= 3; ++n) {
    for (int i = 0; i < 5; ++i)
      EXPECT_NEAR(chi_square_probability(n, kQuantiles[n - 1][i]), kProbabilities[i], 1e-6) << n;
    EXPECT_EQ(chi_square_probability(n, 0), 0);
    EXPECT_EQ(chi_square_probability(n, 1e6), 1);
  }
}

TEST(CurveCounter, CountsTheErrorsInsideEachRegion) {
  CurveCounter counter(2);
  EXPECT_EQ(counter.curve().errors, 0u);
  // Probabilities of two degrees of freedom: 1 - exp(-x / 2) = 0.05, 0.39, 0.78, 0.993; one is not a number.
  for (const double x : {0.1, 1.0, 3.0, 10.0, std::numeric_limits<double>::quiet_NaN()}) counter.add(x);
  const CalibrationCurve curve = counter.curve();
  EXPECT_EQ(curve.errors, 5u);
  constexpr double kShares[] = {0.2, 0.2, 0.2, 0.4, 0.4, 0.4, 0.4, 0.6, 0.6, 0.6, 0.6};
  for (std::size_t i = 0; i < curve.share.size(); ++i)
    EXPECT_DOUBLE_EQ(curve.share[i], kShares[i]) << kClaimedProbabilities[i];
}

}  // namespace
}  // namespace epiline
