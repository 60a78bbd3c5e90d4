#include "estimator/geometry/camera.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {

using Mat2 = Eigen::Matrix2d;
using Coefficients = std::array<double, 6>;

constexpr double kLargestTangent = 20;  // pinhole: 87 degrees off the axis
constexpr double kPi = 3.14159265358979323846;
constexpr int kMaxNewton = 30;
constexpr double kConverged_px = 1e-11;

// Whether t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) still rises at t.
bool rises(const std::array<double, 4>& k, double t) {
  const double s = t * t;
  return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3]))) > 0;
}

// Where that polynomial stops to rise, or `t_max` if it does not before.
double fold(const std::array<double, 4>& k, double t_max) {
  constexpr int kSteps = 4096;
  int i = 1;
  while (i <= kSteps && rises(k, t_max * i / kSteps)) ++i;
  if (i > kSteps) return t_max;
  double below = t_max * (i - 1) / kSteps, above = t_max * i / kSteps;
  for (int n = 0; n < 60; ++n) (rises(k, 0.5 * (below + above)) ? below : above) = 0.5 * (below + above);
  return below;
}

// --- Pinhole, radial-tangential distortion m -> d of the plane z = 1 ---

// D = dd/dm. False where the map folds.
bool distort_radtan(const Coefficients& c, double limit, const Vec2& m, Vec2& d, Mat2& D) {
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4];
  const double x = m.x(), y = m.y(), xx = x * x, yy = y * y, xy = x * y, s = xx + yy;
  const double radial = 1 + s * (k1 + s * (k2 + s * k3));
  const double slope = 2 * (k1 + s * (2 * k2 + 3 * s * k3));  // d radial / dx = slope x
  d.x() = x * radial + 2 * p1 * xy + p2 * (s + 2 * xx);
  d.y() = y * radial + p1 * (s + 2 * yy) + 2 * p2 * xy;
  const double off = slope * xy + 2 * (p1 * x + p2 * y);
  D(0, 0) = radial + slope * xx + 2 * p1 * y + 6 * p2 * x;
  D(1, 1) = radial + slope * yy + 6 * p1 * y + 2 * p2 * x;
  D(0, 1) = D(1, 0) = off;
  return s < limit && D(0, 0) * D(1, 1) > off * off;
}

bool project_radtan(const CameraParameters& c, double limit, const Vec3& p, Vec2& px, Mat23* J) {
  if (!(p.z() > 0)) return false;
  const Vec2 m = p.head<2>() / p.z();
  Vec2 d;
  Mat2 D;
  if (!distort_radtan(c.distortion, limit, m, d, D)) return false;
  const auto& [fx, fy, cx, cy] = c.intrinsics;
  px = {fx * d.x() + cx, fy * d.y() + cy};
  if (J) {
    J->leftCols<2>() = Vec2(fx, fy).asDiagonal() * D / p.z();
    J->col(2) = -J->leftCols<2>() * m;
  }
  return true;
}

// Newton on d(m) = target from the first terms of the inverse series. D: dd/dm at the solution. f: px.
bool undistort_radtan(const Coefficients& c, double f, double limit, const Vec2& target, Vec2& m, Mat2& D) {
  const double converged = kConverged_px * kConverged_px / (f * f);
  const double k1 = c[0], k2 = c[1], s = target.squaredNorm();
  m = target * std::clamp(1 - s * (k1 - s * (3 * k1 * k1 - k2)), 0.2, 2.0);
  if (!(m.squaredNorm() < limit)) m *= 0.5 * std::sqrt(limit / m.squaredNorm());
  for (int i = 0; i < kMaxNewton; ++i) {
    Vec2 d;
    if (!distort_radtan(c, limit, m, d, D)) return false;
    const Vec2 r = target - d;
    if (r.squaredNorm() < converged) return true;
    const double inverse = 1 / (D(0, 0) * D(1, 1) - D(0, 1) * D(1, 0));
    Vec2 step(inverse * (D(1, 1) * r.x() - D(0, 1) * r.y()), inverse * (D(0, 0) * r.y() - D(1, 0) * r.x()));
    for (int k = 0; k < 8 && !((m + step).squaredNorm() < limit); ++k) step *= 0.5;
    m += step;
  }
  return false;
}

// --- Pinhole, equidistant (Kannala-Brandt): radius of the angle theta off the axis ---

double radius(const Coefficients& k, double theta) {
  const double s = theta * theta;
  return theta * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}
double radius_slope(const Coefficients& k, double theta) {
  const double s = theta * theta;
  return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
}

bool project_equidistant(const CameraParameters& c, double limit, const Vec3& p, Vec2& px, Mat23* J) {
  const double across = p.head<2>().norm(), theta = std::atan2(across, p.z());
  if (!(theta < limit) || (across == 0 && !(p.z() > 0))) return false;
  const auto& [fx, fy, cx, cy] = c.intrinsics;
  const double scale = across > 0 ? radius(c.distortion, theta) / across : 1 / p.z();
  px = {fx * scale * p.x() + cx, fy * scale * p.y() + cy};
  if (J) {
    const Vec2 e = across > 0 ? Vec2(p.head<2>() / across) : Vec2::Zero();
    const double slope = radius_slope(c.distortion, theta) / p.squaredNorm();
    Mat23 D;
    D.leftCols<2>() = scale * Mat2::Identity() + (slope * p.z() - scale) * e * e.transpose();
    D.col(2) = -slope * p.head<2>();
    *J = Vec2(fx, fy).asDiagonal() * D;
  }
  return true;
}

// Newton in a bracket: the radius rises up to `limit`.
bool unproject_equidistant(const CameraParameters& c, double limit, const Vec2& d, Vec3& f) {
  const double target = d.norm();
  if (!(target < radius(c.distortion, limit))) return false;
  if (target == 0) {
    f = Vec3::UnitZ();
    return true;
  }
  double below = 0, above = limit, theta = std::min(target, 0.9 * limit);
  const double converged = kConverged_px / std::max(c.intrinsics[0], c.intrinsics[1]);
  for (int i = 0; i < 2 * kMaxNewton; ++i) {
    const double error = radius(c.distortion, theta) - target;
    if (std::abs(error) < converged) break;
    (error < 0 ? below : above) = theta;
    theta -= error / radius_slope(c.distortion, theta);
    if (!(theta > below && theta < above)) theta = 0.5 * (below + above);
  }
  f << std::sin(theta) / target * d, std::cos(theta);
  return true;
}

// --- Double sphere ---

bool project_double_sphere(const CameraParameters& c, const Vec3& p, Vec2& px, Mat23* J) {
  const double xi = c.distortion[0], alpha = c.distortion[1];
  const double w1 = alpha > 0.5 ? (1 - alpha) / alpha : alpha / (1 - alpha);
  const double w2 = (w1 + xi) / std::sqrt(2 * w1 * xi + xi * xi + 1);
  const double d1 = p.norm();
  if (!(p.z() > -w2 * d1)) return false;
  const double z1 = xi * d1 + p.z();  // seen from the centre of the second sphere
  const double d2 = std::sqrt(p.head<2>().squaredNorm() + z1 * z1);
  const double n = alpha * d2 + (1 - alpha) * z1;
  if (!(n > 0)) return false;
  const auto& [fx, fy, cx, cy] = c.intrinsics;
  const Vec2 m = p.head<2>() / n;
  px = {fx * m.x() + cx, fy * m.y() + cy};
  if (J) {
    const Vec3 dz1 = xi / d1 * p + Vec3::UnitZ();
    const Vec3 dd2 = (Vec3(p.x(), p.y(), 0) + z1 * dz1) / d2;
    const Vec3 dn = alpha * dd2 + (1 - alpha) * dz1;
    Mat23 D;
    D << Mat2::Identity(), Vec2::Zero();
    *J = Vec2(fx, fy).asDiagonal() * (D - m * dn.transpose()) / n;
  }
  return true;
}

bool unproject_double_sphere(const CameraParameters& c, const Vec2& m, Vec3& f) {
  const double xi = c.distortion[0], alpha = c.distortion[1], s = m.squaredNorm();
  const double inside = 1 - (2 * alpha - 1) * s;
  if (!(inside >= 0)) return false;
  const double mz = (1 - alpha * alpha * s) / (alpha * std::sqrt(inside) + 1 - alpha);
  const double root = mz * mz + (1 - xi * xi) * s;
  if (!(root >= 0)) return false;
  const double k = (mz * xi + std::sqrt(root)) / (mz * mz + s);
  f << k * m, k * mz - xi;
  return f.allFinite();
}

// --- Unified: a sphere or, with beta, an ellipsoid before a pinhole, then the radial-tangential distortion ---

Coefficients after_sphere(const CameraParameters& c) {
  return {c.distortion[2], c.distortion[3], c.distortion[4], c.distortion[5]};
}

bool project_unified(const CameraParameters& c, double limit, const Vec3& p, Vec2& px, Mat23* J) {
  const double alpha = c.distortion[0], beta = c.distortion[1];
  const double w = alpha > 0.5 ? (1 - alpha) / alpha : alpha / (1 - alpha);
  const double depth = std::sqrt(beta * p.head<2>().squaredNorm() + p.z() * p.z());
  const double n = alpha * depth + (1 - alpha) * p.z();
  if (!(p.z() > -w * depth && n > 0)) return false;
  const Vec2 m = p.head<2>() / n;
  Vec2 d;
  Mat2 D;
  if (!distort_radtan(after_sphere(c), limit, m, d, D)) return false;
  const auto& [fx, fy, cx, cy] = c.intrinsics;
  px = {fx * d.x() + cx, fy * d.y() + cy};
  if (J) {
    const Vec3 dn = alpha / depth * Vec3(beta * p.x(), beta * p.y(), p.z()) + (1 - alpha) * Vec3::UnitZ();
    Mat23 dm;
    dm << Mat2::Identity(), Vec2::Zero();
    *J = Vec2(fx, fy).asDiagonal() * D * (dm - m * dn.transpose()) / n;
  }
  return true;
}

bool unproject_unified(const CameraParameters& c, double limit, const Vec2& d, Vec3& f) {
  const double alpha = c.distortion[0], beta = c.distortion[1];
  Vec2 m;
  Mat2 D;
  if (!undistort_radtan(after_sphere(c), std::max(c.intrinsics[0], c.intrinsics[1]), limit, d, m, D)) return false;
  const double s = beta * m.squaredNorm(), inside = 1 - (2 * alpha - 1) * s;
  if (!(inside >= 0)) return false;
  f = Vec3(m.x(), m.y(), (1 - alpha * alpha * s) / (alpha * std::sqrt(inside) + 1 - alpha)).normalized();
  return f.allFinite();
}

}  // namespace

CameraFault fault_of(const CameraParameters& c) noexcept {
  if (c.width <= 0 || c.height <= 0) return CameraFault::kSize;
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::all_of(c.intrinsics.begin(), c.intrinsics.end(), finite)) return CameraFault::kNotFinite;
  if (!std::all_of(c.distortion.begin(), c.distortion.end(), finite) || !finite(c.readout_s))
    return CameraFault::kNotFinite;
  const auto& [fx, fy, cx, cy] = c.intrinsics;
  if (fx <= 0 || fy <= 0) return CameraFault::kFocal;
  if (cx < 0 || cy < 0 || cx > c.width - 1 || cy > c.height - 1) return CameraFault::kCentre;
  const auto share = [](double alpha) { return alpha >= 0 && alpha <= 1; };
  const double first = c.distortion[0], second = c.distortion[1];
  if (c.model == CameraModel::kDoubleSphere && !(share(second) && first > -1 && first <= 1))
    return CameraFault::kDistortion;
  if (c.model == CameraModel::kUnified && !(share(first) && second > 0)) return CameraFault::kDistortion;
  return CameraFault::kNone;
}

Camera::Camera(const CameraParameters& parameters) : c_(parameters) {
  const auto& k = c_.distortion;
  if (c_.model == CameraModel::kPinholeRadialTangential) {
    const double tangent = fold({k[0], k[1], k[4], 0}, kLargestTangent);
    limit_ = tangent * tangent;
  } else if (c_.model == CameraModel::kPinholeEquidistant) {
    limit_ = fold({k[0], k[1], k[2], k[3]}, kPi);
  } else if (c_.model == CameraModel::kUnified) {
    const double radius = fold({k[2], k[3], 0, 0}, kLargestTangent);
    limit_ = radius * radius;
  }
}

bool Camera::project(const Vec3& p_C, Vec2& px, Mat23* d_px_d_p) const noexcept {
  switch (c_.model) {
    case CameraModel::kPinholeRadialTangential:
      return project_radtan(c_, limit_, p_C, px, d_px_d_p);
    case CameraModel::kPinholeEquidistant:
      return project_equidistant(c_, limit_, p_C, px, d_px_d_p);
    case CameraModel::kDoubleSphere:
      return project_double_sphere(c_, p_C, px, d_px_d_p);
    case CameraModel::kUnified:
      return project_unified(c_, limit_, p_C, px, d_px_d_p);
  }
  return false;
}

bool Camera::unproject(const Vec2& px, Vec3& f_C) const noexcept {
  const auto& [fx, fy, cx, cy] = c_.intrinsics;
  const Vec2 d((px.x() - cx) / fx, (px.y() - cy) / fy);
  switch (c_.model) {
    case CameraModel::kPinholeRadialTangential: {
      Vec2 m;
      Mat2 D;
      if (!undistort_radtan(c_.distortion, std::max(fx, fy), limit_, d, m, D)) return false;
      f_C = Vec3(m.x(), m.y(), 1).normalized();
      return true;
    }
    case CameraModel::kPinholeEquidistant:
      return unproject_equidistant(c_, limit_, d, f_C);
    case CameraModel::kDoubleSphere:
      return unproject_double_sphere(c_, d, f_C);
    case CameraModel::kUnified:
      return unproject_unified(c_, limit_, d, f_C);
  }
  return false;
}

bool Camera::bearing(const Vec2& px, Vec3& f_C, Mat23& d_px_d_f) const noexcept {
  if (c_.model == CameraModel::kPinholeRadialTangential) {  // the solution brings its derivative along
    const auto& [fx, fy, cx, cy] = c_.intrinsics;
    Vec2 m;
    Mat2 D;
    const Vec2 d((px.x() - cx) / fx, (px.y() - cy) / fy);
    if (!undistort_radtan(c_.distortion, std::max(fx, fy), limit_, d, m, D)) return false;
    const double length = std::sqrt(1 + m.squaredNorm());
    f_C = Vec3(m.x(), m.y(), 1) / length;
    d_px_d_f.leftCols<2>() = Vec2(fx * length, fy * length).asDiagonal() * D;
    d_px_d_f.col(2) = -d_px_d_f.leftCols<2>() * m;
    return true;
  }
  Vec2 again;
  return unproject(px, f_C) && project(f_C, again, &d_px_d_f);
}

double Camera::focal_px() const {
  const double mean = 0.5 * (c_.intrinsics[0] + c_.intrinsics[1]);
  return c_.model == CameraModel::kDoubleSphere ? mean / (1 + c_.distortion[0]) : mean;
}

}  // namespace epiline
