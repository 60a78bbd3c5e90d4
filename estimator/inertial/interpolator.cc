#include "estimator/inertial/interpolator.h"

namespace epiline {

namespace {
constexpr double kLearntWeight = 1.0 / 256, kLearntError = 1.0 / 64;
constexpr double kMostLearntError = 4;                   // times the usual error: more is an impact, or corrupt
constexpr double kMostWeight = 1, kLeastWeight = -0.75;  // from a smooth curve to a change of sign

Interpolator::Values mean(const Interpolator::Neighbours& n) {
  return 0.25 * (n.before2 + n.before1 + n.after1 + n.after2);
}
/// How far the nearest two lie beside the mean of all four.
Interpolator::Values bend(const Interpolator::Neighbours& n) {
  return 0.5 * (n.before1 + n.after1 - n.before2 - n.after2);
}
}  // namespace

Interpolator::Values Interpolator::between(const Neighbours& n) const {
  return mean(n) + (product_ / square_).min(kMostWeight).max(kLeastWeight) * bend(n);
}

void Interpolator::learn(const Neighbours& n, const Values& measured) {
  const Values error = (measured - between(n)).abs(), most = kMostLearntError * error_ + 1e-3;
  error_ += kLearntError * (error.min(most) - error_);
  const Values beside = bend(n), share = (error <= most).cast<double>() * kLearntWeight;
  square_ += share * (beside.square() + 1e-12 - square_);
  product_ += share * (beside * (measured - mean(n)) - product_);
}

}  // namespace epiline
