#pragma once
// Visual factors written down directly, their Jacobians numerical.
#include <Eigen/Core>
#include <cmath>
#include <initializer_list>
#include <set>

#include "estimator/factors/visual.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

/// A pinhole camera's centre and attitude when it took frame k.
struct Camera {
  Mat3 R;
  Vec3 c;
};
inline Camera camera(const Window& w, int k) {
  const Slot& s = w.at(k);
  const double dt = w.calibration.time_offset - s.time_offset_used;
  const Mat3 R = s.x.R * so3_exp((s.omega - s.x.b_g) * dt);
  Vec3 v = s.x.v;
  if (k + 1 < w.size()) {  // by both positions and the forces between them
    const Slot& next = w.at(k + 1);
    v = (next.x.p - s.x.p - s.x.R * next.imu.dp - 0.5 * next.imu.T * next.imu.T * kGravity_W) / next.imu.T;
  }
  return {R * w.calibration.R_BC, s.x.p + v * dt + R * w.calibration.p_BC};
}

template <int rows>
using Residual = Eigen::Matrix<double, rows, 1>;

template <int rows, class Function>
Residual<rows> central_difference(Function&& at) {
  constexpr double h = 1e-5;
  return (at(h) - at(-h)) / (2 * h);
}

/// Slopes of a residual by the poses of `frames` frames (dp, then dphi in the world), of which it depends on a few and
/// on those after them, and by the calibration.
template <int rows, class Function>
Eigen::Matrix<double, rows, Eigen::Dynamic> slopes(Window& w, int frames, std::initializer_list<int> on,
                                                   Function&& residual) {
  Eigen::Matrix<double, rows, Eigen::Dynamic> J = Eigen::MatrixXd::Zero(rows, 6 * frames + kCameraCalibration);
  std::set<int> poses(on);
  for (const int k : on)
    if (k + 1 < frames) poses.insert(k + 1);
  for (const int k : poses)
    for (int c = 0; c < 6; ++c)
      J.col(6 * k + c) = central_difference<rows>([&](double d) {
        NavState& x = w.at(k).x;
        const NavState keep = x;
        if (c < 3)
          x.p[c] += d;
        else
          x.R = so3_exp(d * Vec3::Unit(c - 3)) * x.R;
        const Residual<rows> r = residual();
        x = keep;
        return r;
      });
  for (int c = 0; c < kCameraCalibration; ++c)
    J.col(6 * frames + c) = central_difference<rows>([&](double d) {
      const Calibration keep = w.calibration;
      retract(w.calibration, d * CalibrationTangent::Unit(c));
      const Residual<rows> r = residual();
      w.calibration = keep;
      return r;
    });
  return J;
}

/// Adds a residual under Huber's kernel.
template <class Slopes, class Length>
void add_huber(const Slopes& J, const Length& r, Eigen::MatrixXd& H, Eigen::VectorXd& b, double& cost) {
  const double length = r.norm(), weight = length <= 1 ? 1 : 1 / length;
  cost += length <= 1 ? length * length : 2 * length - 1;
  H += weight * J.transpose() * J;
  b -= weight * J.transpose() * r;
}

/// Poses of frames 0..frames-1 (world perturbations), then the calibration.
inline Eigen::MatrixXd dense(const VisualSystem& v, int frames) {
  const int c = 6 * frames;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(c + kCameraCalibration, c + kCameraCalibration);
  for (int k = 0; k < frames; ++k) {
    for (int l = k; l < frames; ++l)
      H.block<6, 6>(6 * k, 6 * l) = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(v.H[k][l]);
    for (int j = 0; j < kCameraCalibration; ++j)
      H.block<6, 1>(6 * k, c + j) = Eigen::Map<const Vec6>(v.H_ck[k] + 6 * j);
  }
  H.bottomRightCorner<kCameraCalibration, kCameraCalibration>() =
      Eigen::Map<const Eigen::Matrix<double, kCameraCalibration, kCameraCalibration, Eigen::RowMajor>>(v.H_cc);
  return H.selfadjointView<Eigen::Upper>();
}

inline Eigen::VectorXd dense_rhs(const VisualSystem& v, int frames) {
  Eigen::VectorXd b(6 * frames + kCameraCalibration);
  for (int k = 0; k < frames; ++k) b.segment<6>(6 * k) = Eigen::Map<const Vec6>(v.b[k]);
  b.tail<kCameraCalibration>() = Eigen::Map<const Eigen::Matrix<double, kCameraCalibration, 1>>(v.b_c);
  return b;
}

/// 1 over what is known of each unknown; 1 where nothing is said of it.
inline Eigen::VectorXd units(const Eigen::MatrixXd& H) {
  return H.diagonal().unaryExpr([](double h) { return h > 0 ? 1 / std::sqrt(h) : 1; });
}

/// Largest difference of two matrices whose unknowns differ in unit, relative to the diagonal of the second.
inline double scaled_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::VectorXd unit = units(b);
  return (unit.asDiagonal() * (a - b) * unit.asDiagonal()).cwiseAbs().maxCoeff();
}

}  // namespace epiline::test
