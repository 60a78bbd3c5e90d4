#include "estimator/geometry/so3.h"

#include <Eigen/Geometry>
#include <cmath>

namespace epiline {

Mat3 skew(const Vec3& a) {
  Mat3 m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

namespace {
// sin(t)/t, (1-cos t)/t^2, (t-sin t)/t^3; series below, where the closed forms cancel.
struct ExponentialCoefficients {
  double a, b, c;
};
ExponentialCoefficients coefficients(double t2) {
  if (t2 < 1e-4)
    return {1 - t2 / 6 + t2 * t2 / 120, 0.5 - t2 / 24 + t2 * t2 / 720, 1.0 / 6 - t2 / 120 + t2 * t2 / 5040};
  const double t = std::sqrt(t2);
  return {std::sin(t) / t, (1 - std::cos(t)) / t2, (t - std::sin(t)) / (t2 * t)};
}
}  // namespace

Mat3 so3_exp(const Vec3& theta) {
  const ExponentialCoefficients k = coefficients(theta.squaredNorm());
  const Mat3 W = skew(theta);
  return Mat3::Identity() + k.a * W + k.b * (W * W);
}

Vec3 so3_log(const Mat3& R) {
  const Eigen::Quaterniond q(R);  // stable near pi, where the antisymmetric part vanishes
  Vec3 v = q.vec();
  double w = q.w();
  if (w < 0) {
    v = -v;
    w = -w;
  }
  const double n = v.norm();
  if (n < 1e-9) return 2 * v;
  return (2 * std::atan2(n, w) / n) * v;
}

Mat3 so3_right_jacobian(const Vec3& theta) {
  const ExponentialCoefficients k = coefficients(theta.squaredNorm());
  const Mat3 W = skew(theta);
  return Mat3::Identity() - k.b * W + k.c * (W * W);
}

Mat3 so3_right_jacobian_inverse(const Vec3& theta) {
  const double t2 = theta.squaredNorm();
  const Mat3 W = skew(theta);
  double d = 1.0 / 12 + t2 / 720;
  if (t2 > 1e-4) {
    const double half = 0.5 * std::sqrt(t2);
    d = (1 - half / std::tan(half)) / t2;  // in the half angle: regular at pi
  }
  return Mat3::Identity() + 0.5 * W + d * (W * W);
}

Mat3 so3_normalised(const Mat3& R) { return Eigen::Quaterniond(R).normalized().toRotationMatrix(); }

}  // namespace epiline
