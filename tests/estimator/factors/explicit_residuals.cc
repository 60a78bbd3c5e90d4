#include "tests/estimator/factors/explicit_residuals.h"

#include <cmath>
#include <set>

#include "tests/estimator/dense_algebra.h"

namespace epiline::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Camera camera(const Window& w, int k) {
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

VectorXd central_difference(const std::function<VectorXd(double)>& at) {
  constexpr double h = 1e-5;
  return (at(h) - at(-h)) / (2 * h);
}

MatrixXd slopes(Window& w, int rows, int frames, std::initializer_list<int> on,
                const std::function<VectorXd()>& residual) {
  MatrixXd J = MatrixXd::Zero(rows, 6 * frames + kCameraCalibration);
  std::set<int> poses(on);
  for (const int k : on)
    if (k + 1 < frames) poses.insert(k + 1);
  for (const int k : poses)
    for (int c = 0; c < 6; ++c)
      J.col(6 * k + c) = central_difference([&](double d) {
        NavState& x = w.at(k).x;
        const NavState keep = x;
        if (c < 3)
          x.p[c] += d;
        else
          x.R = so3_exp(d * Vec3::Unit(c - 3)) * x.R;
        VectorXd r = residual();
        x = keep;
        return r;
      });
  for (int c = 0; c < kCameraCalibration; ++c)
    J.col(6 * frames + c) = central_difference([&](double d) {
      const Calibration keep = w.calibration;
      retract(w.calibration, d * CalibrationTangent::Unit(c));
      VectorXd r = residual();
      w.calibration = keep;
      return r;
    });
  return J;
}

void add_huber(const MatrixXd& J, const VectorXd& r, MatrixXd& H, VectorXd& b, double& cost) {
  const double length = r.norm();
  cost += length <= 1 ? length * length : 2 * length - 1;
  add_equations(length <= 1 ? 1 : 1 / length, J, r, H, b);
}

MatrixXd dense(const VisualSystem& v, int frames) {
  const int c = 6 * frames;
  MatrixXd H = MatrixXd::Zero(c + kCameraCalibration, c + kCameraCalibration);
  const auto set = [&](int i, int j, double x) { H(i, j) = H(j, i) = x; };
  for (int k = 0; k < frames; ++k)
    for (int i = 0; i < 6; ++i) {
      for (int l = k; l < frames; ++l)
        for (int j = l == k ? i : 0; j < 6; ++j) set(6 * k + i, 6 * l + j, v.H[k][l][6 * i + j]);
      for (int j = 0; j < kCameraCalibration; ++j) set(6 * k + i, c + j, v.H_ck[k][6 * j + i]);
    }
  for (int i = 0; i < kCameraCalibration; ++i)
    for (int j = i; j < kCameraCalibration; ++j) set(c + i, c + j, v.H_cc[kCameraCalibration * i + j]);
  return H;
}

VectorXd dense_rhs(const VisualSystem& v, int frames) {
  VectorXd b(6 * frames + kCameraCalibration);
  for (int i = 0; i < 6 * frames; ++i) b[i] = v.b[i / 6][i % 6];
  for (int i = 0; i < kCameraCalibration; ++i) b[6 * frames + i] = v.b_c[i];
  return b;
}

VectorXd units(const MatrixXd& H) {
  VectorXd unit = VectorXd::Ones(H.rows());
  for (int i = 0; i < H.rows(); ++i)
    if (H(i, i) > 0) unit[i] = std::sqrt(H(i, i));
  return unit;
}

double scaled_difference(const MatrixXd& a, const MatrixXd& b) {
  return in_units(a - b, units(b)).cwiseAbs().maxCoeff();
}

double scaled_difference(const VectorXd& a, const VectorXd& b, const MatrixXd& H) {
  const VectorXd unit = units(H);
  return (a - b).cwiseQuotient(unit).norm() / b.cwiseQuotient(unit).norm();
}

}  // namespace epiline::test
