#include "drivers/study/evaluate/calibration_curve.h"

#include <cmath>
#include <numbers>

namespace epiline {

double chi_square_probability(int degrees_of_freedom, double x) {
  if (degrees_of_freedom == 2) return -std::expm1(-x / 2);
  const double one = std::erf(std::sqrt(x / 2));
  return degrees_of_freedom == 1 ? one : one - std::sqrt(2 * x / std::numbers::pi) * std::exp(-x / 2);
}

void CurveCounter::add(double normalised_squared) {
  ++errors_;
  const double claimed = chi_square_probability(degrees_of_freedom_, normalised_squared);
  for (std::size_t i = 0; i < inside_.size(); ++i) inside_[i] += claimed <= kClaimedProbabilities[i];
}

CalibrationCurve CurveCounter::curve() const {
  CalibrationCurve curve{errors_, {}};
  for (std::size_t i = 0; i < inside_.size() && errors_ > 0; ++i)
    curve.share[i] = static_cast<double>(inside_[i]) / static_cast<double>(errors_);
  return curve;
}

}  // namespace epiline
