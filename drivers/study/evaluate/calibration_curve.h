#pragma once
// How often errors stay within what a covariance claims. Derivation: docs/derivations/consistency.md.
#include <array>
#include <cstddef>

namespace epiline {

inline constexpr std::array<double, 11> kClaimedProbabilities = {0.1, 0.2, 0.3, 0.4,  0.5, 0.6,
                                                                 0.7, 0.8, 0.9, 0.95, 0.99};

/// For each of kClaimedProbabilities the share of errors inside the region that holds so many of them by the claimed
/// covariance. Equal to the probability where the covariance tells the truth, below it where it is too small.
struct CalibrationCurve {
  std::size_t errors = 0;  ///< 0: no curve
  std::array<double, kClaimedProbabilities.size()> share{};
};

/// Probability that a chi-square variable of 1, 2 or 3 degrees of freedom is at most x, which is not negative.
double chi_square_probability(int degrees_of_freedom, double x);

/// Counts normalised errors squared of one number of degrees of freedom (1, 2 or 3).
class CurveCounter {
 public:
  explicit CurveCounter(int degrees_of_freedom) : degrees_of_freedom_(degrees_of_freedom) {}
  void add(double normalised_squared);
  CalibrationCurve curve() const;

 private:
  int degrees_of_freedom_;
  std::size_t errors_ = 0;
  std::array<std::size_t, kClaimedProbabilities.size()> inside_{};
};

}  // namespace epiline
