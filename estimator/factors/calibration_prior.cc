#include "estimator/factors/calibration_prior.h"

#include <cmath>

namespace epiline {

namespace {
constexpr double kFreedom = 1, kNumbers = 3;  // of the Student distribution: degrees of freedom; numbers it is of
/// The scale s for a standard deviation sigma near the centre, where the information is (nu + 3)/(nu s^2).
double scale_squared(double sigma) { return sigma * sigma * (kFreedom + kNumbers) / kFreedom; }
}  // namespace

double add_calibration_prior(const Window& w, const Share& share, NormalEquations* out) {
  const CalibrationPrior& p = w.calibration_prior;
  if (!p.in_use || share.oldest_only) return 0;
  const CalibrationTangent d = local(p.configured, w.calibration);
  CalibrationTangent g = CalibrationTangent::Zero(), information = CalibrationTangent::Zero();
  double cost = 0;
  for (const auto& [at, sigma] : {std::pair{1, p.sigma_rotation}, std::pair{4, p.sigma_translation}}) {
    const double s2 = scale_squared(sigma), q = d.segment<3>(at).squaredNorm() / s2;
    const double weight = (kFreedom + kNumbers) / (kFreedom + q) / s2;
    cost += (kFreedom + kNumbers) * std::log1p(q / kFreedom);
    // Of the rotation, too: J_r^-T(d) d = d.
    g.segment<3>(at) = -weight * d.segment<3>(at);
    information.segment<3>(at).setConstant(weight);
  }
  if (!out) return cost;
  out->add(calibration_of_camera(), g);
  out->add(calibration_of_camera(), calibration_of_camera(),
           Eigen::Matrix<double, kCalibration, kCalibration>(information.asDiagonal()));
  return cost;
}

}  // namespace epiline
