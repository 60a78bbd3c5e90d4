#include "estimator/initialise/start_point.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr double kDepthDamping = 0.04;             // (1/m)^-2: holds an inverse depth that the images do not see
constexpr double kDepthPrior = 0.2;                // 1/m, the inverse depth where there is no parallax at all
constexpr double kNearest = 8, kFarthest = 0.004;  // bounds of the inverse depth, 1/m
constexpr int kTurning = 5;                        // column of b_g, the only one that turns cameras
constexpr int kColumns = 12;                       // of the tangent, padded to whole vectors

/// Lower Cholesky factor of a symmetric positive definite 3x3, with inverted diagonal.
struct Cholesky3 {
  double d0, d1, d2, l10, l20, l21;
  explicit Cholesky3(const Mat3& M) {
    d0 = 1 / std::sqrt(M(0, 0));
    l10 = M(1, 0) * d0;
    l20 = M(2, 0) * d0;
    d1 = 1 / std::sqrt(M(1, 1) - l10 * l10);
    l21 = (M(2, 1) - l20 * l10) * d1;
    d2 = 1 / std::sqrt(M(2, 2) - l20 * l20 - l21 * l21);
  }
  Vec3 forward(const Vec3& y) const {
    const double a = y[0] * d0, b = (y[1] - l10 * a) * d1;
    return {a, b, (y[2] - l20 * a - l21 * b) * d2};
  }
  Vec3 solve(const Vec3& y) const {
    const Vec3 z = forward(y);
    const double c = z[2] * d2, b = (z[1] - l21 * c) * d1;
    return {(z[0] - l10 * b - l20 * c) * d0, b, c};
  }
};

/// The derivative of the eliminated point's equations by the start's tangent, row by row.
struct Rows {
  alignas(64) double q[3][kColumns] = {};

  /// Columns of both biases: q -= A J for the position's derivative by them.
  void subtract_biases(const Mat3& A, const Eigen::Matrix<double, 3, 6>& J) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 6; ++c) q[r][kTurning + c] -= A(r, 0) * J(0, c) + A(r, 1) * J(1, c) + A(r, 2) * J(2, c);
  }
  void add_turning(const Mat3& A, const Mat3& J) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) q[r][kTurning + c] += A(r, 0) * J(0, c) + A(r, 1) * J(1, c) + A(r, 2) * J(2, c);
  }
  void forward(const Cholesky3& L) {
    for (int c = 0; c < kColumns; ++c) {
      const double a = q[0][c] * L.d0, b = (q[1][c] - L.l10 * a) * L.d1;
      q[0][c] = a;
      q[1][c] = b;
      q[2][c] = (q[2][c] - L.l20 * a - L.l21 * b) * L.d2;
    }
  }
  /// n -= q' (q, z), H its upper half.
  void eliminate(const Vec3& z, StartNormal& n) const {
    for (int i = 0; i < kStartDof; ++i) {
      const double a = q[0][i], b = q[1][i], c = q[2][i];
      double* column = n.H.data() + kStartDof * i;  // symmetric: the column stands for the row
      for (int j = 0; j <= i; ++j) column[j] -= a * q[0][j] + b * q[1][j] + c * q[2][j];
      n.b[i] -= a * z[0] + b * z[1] + c * z[2];
    }
  }
};

}  // namespace

StartSums::StartSums(int frames) {
  std::fill_n(H.begin(), frames, Eigen::Matrix<double, 6, 6>::Zero());
  std::fill_n(b.begin(), frames, Eigen::Matrix<double, 6, 1>::Zero());
}

double StartSums::mean_score(int frames) const {
  double sum = 0;
  for (int k = 0; k < frames; ++k) {
    Eigen::Matrix<double, 6, 6> full = H[k].selfadjointView<Eigen::Upper>();
    full.diagonal().array() += 1e-6;
    sum += b[k].dot(full.llt().solve(b[k])) / 6;
  }
  return sum / frames;
}

void StartSums::finish(const StartViews& view, int frames, const Eigen::Matrix<double, 3, 2>& gravity) {
  Eigen::Matrix<double, 6, kStartDof> J = Eigen::Matrix<double, 6, kStartDof>::Zero();
  for (int k = 0; k < frames; ++k) {
    const StartView& v = view[k];
    J.topLeftCorner<3, 3>() = Mat3::Identity() * v.T;
    J.block<3, 2>(0, 3) = (0.5 * v.T * v.T) * gravity;
    J.topRightCorner<3, 6>() = v.p_b;
    J.block<3, 3>(3, kTurning) = v.dphi;
    Eigen::Matrix<double, 6, 6> full = H[k];
    full.bottomLeftCorner<3, 3>() = full.topRightCorner<3, 3>().transpose();
    total.H.triangularView<Eigen::Upper>() += J.transpose() * full * J;
    total.b += J.transpose() * b[k];
  }
}

PointElimination::PointElimination(const StartTrack& track, const StartViews& view, double sigma, double kernel)
    : track_(track), view_(view), sigma2_(sigma * sigma), kernel2_(kernel * kernel), origin_(view[track.frame[0]].c) {
  for (int q = 0; q < track.count; ++q) {
    const StartView& v = view[track.frame[q]];
    f_[q] = v.R * track.f_C[q];
    centre_[q] = origin_ - v.c;
    seen_ += f_[q].cross(centre_[q]).squaredNorm();
  }
  // Where the images see the depth the damping must go: over a hundred tracks it would pass for knowledge of scale.
  damping_ = std::max(0.0, kDepthDamping - seen_ / sigma2_);
}

void PointElimination::estimate() {
  double num = kDepthDamping * sigma2_ * kDepthPrior;
  for (int q = 0; q < track_.count; ++q) num -= f_[q].cross(centre_[q]).dot(f_[q].cross(x_.m));
  x_.rho = std::clamp(num / (kDepthDamping * sigma2_ + seen_), kFarthest, kNearest);
}

void PointElimination::solve(const StartPoint& start, int steps) {
  x_ = start;
  if (start.rho == 0) x_.m = f_[0];
  estimate();
  for (int n = 0; n < steps; ++n) {
    linearise();
    step();
  }
  linearise();
}

void PointElimination::step() {
  const Vec3 dm = Cholesky3(M_).solve(y_);
  const double along = x_.m.dot(dm) / x_.m.squaredNorm();
  x_.m += dm - along * x_.m;
  x_.rho = std::clamp(x_.rho * (1 - along), kFarthest, kNearest);
}

/// Residuals in the plane tangent to each measured bearing f, their weights and the normal equations of m. With y the
/// predicted ray scaled to f.y = 1 the residual is f - y and its derivative by m -(I - y f')/depth.
void PointElimination::linearise() {
  const double m2 = x_.m.squaredNorm();
  M_ = (damping_ * x_.rho * x_.rho / (m2 * m2)) * x_.m * x_.m.transpose();
  M_.diagonal().array() += 1e-9;
  y_.setZero();
  double product = 1;
  for (int q = 0; q < track_.count; ++q) {
    const Vec3& f = f_[q];
    const Vec3 Y = x_.m + x_.rho * centre_[q];
    const double depth = f.dot(Y);
    if (depth < 0.05) {  // behind the camera: no derivative, the cost of a gross error
      W_[q].setZero();
      h_[q].setZero();
      s_[q] = 1e6;
    } else {
      const double inverse = 1 / depth;
      const Vec3 y = inverse * Y, e = y - f;
      const double e2 = e.squaredNorm();
      s_[q] = e2 / sigma2_;
      const double w = inverse / ((1 + s_[q] / kernel2_) * sigma2_);
      const Vec3 side = (0.5 * y.squaredNorm()) * f - y;
      const double a = w * inverse;
      Mat3& W = W_[q];
      W(0, 0) = a * (1 + 2 * side[0] * f[0]);
      W(1, 1) = a * (1 + 2 * side[1] * f[1]);
      W(2, 2) = a * (1 + 2 * side[2] * f[2]);
      W(0, 1) = W(1, 0) = a * (side[0] * f[1] + side[1] * f[0]);
      W(0, 2) = W(2, 0) = a * (side[0] * f[2] + side[2] * f[0]);
      W(1, 2) = W(2, 1) = a * (side[1] * f[2] + side[2] * f[1]);
      h_[q] = w * (e2 * f - e);
    }
    product *= 1 + s_[q] / kernel2_;
    M_ += W_[q];
    y_ += h_[q];
  }
  cost_ = kernel2_ * std::log(product);
}

void PointElimination::add_to(const Eigen::Matrix<double, 3, 2>& gravity, StartSums& sum) const {
  Rows rows;
  Mat3 by_velocity = Mat3::Zero(), by_gravity = Mat3::Zero();
  for (int q = 0; q < track_.count; ++q) {
    const int k = track_.frame[q];
    const StartView& v = view_[k];
    const Vec3 lever = x_.m + x_.rho * (origin_ - v.p);
    const Mat3& W = W_[q];
    Mat3 WL;  // W [lever]x
    for (int r = 0; r < 3; ++r) {
      WL(r, 0) = W(r, 1) * lever[2] - W(r, 2) * lever[1];
      WL(r, 1) = W(r, 2) * lever[0] - W(r, 0) * lever[2];
      WL(r, 2) = W(r, 0) * lever[1] - W(r, 1) * lever[0];
    }
    const Mat3 A = x_.rho * W;
    Eigen::Matrix<double, 6, 6>& H = sum.H[k];
    H.topLeftCorner<3, 3>() += x_.rho * A;
    H.topRightCorner<3, 3>() -= x_.rho * WL;
    H.bottomRightCorner<3, 3>() -= skew(lever).lazyProduct(WL);
    Eigen::Matrix<double, 6, 1>& b = sum.b[k];
    b.head<3>() -= x_.rho * h_[q];
    b.tail<3>() -= lever.cross(h_[q]);
    by_velocity += v.T * A;
    by_gravity += (0.5 * v.T * v.T) * A;
    rows.subtract_biases(A, v.p_b);
    rows.add_turning(WL, v.dphi);
  }
  const Eigen::Matrix<double, 3, 2> turns = by_gravity * gravity;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rows.q[r][c] = -by_velocity(r, c);
    for (int c = 0; c < 2; ++c) rows.q[r][3 + c] = -turns(r, c);
  }
  const Cholesky3 L(M_);
  rows.forward(L);
  rows.eliminate(L.forward(y_), sum.total);
  sum.total.cost += cost_;
}

}  // namespace epiline
