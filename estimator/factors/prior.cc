#include "estimator/factors/prior.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cstring>

namespace epiline {

void prior_difference(const Window& w, double* d) {
  const Prior& p = w.prior;
  for (int k = 0; k < p.frames; ++k) Eigen::Map<Vec6>(d + 6 * k) = local_pose(p.x0[k], w.at(k).x);
  Eigen::Map<Vec9>(d + 6 * p.frames) = local_velocity_biases(p.x0[0], w.at(0).x);
  Eigen::Map<CalibrationTangent>(d + p.calibration_row()) = local(p.c0, w.calibration);
}

namespace {
template <int rows, int columns>
auto block_of(const Prior& p, int row, int column) {
  return Eigen::Map<const Eigen::Matrix<double, rows, columns, Eigen::RowMajor>, 0,
                    Eigen::OuterStride<kMarginalStride>>(&p.H[row][column]);
}

/// The prior's information as blocks of (poses, velocity and biases of frame 0, calibration), of its lower triangle.
void add_information(const Prior& p, NormalEquations& out) {
  const int n = p.frames, v = 6 * n, c = p.calibration_row();
  for (int k = 0; k < n; ++k) {
    for (int l = k; l < n; ++l) out.add(pose_of(l), pose_of(k), block_of<6, 6>(p, 6 * l, 6 * k));
    out.add(velocity_biases_of(0), pose_of(k), block_of<9, 6>(p, v, 6 * k));
    out.add(calibration_of_camera(), pose_of(k), block_of<kCalibration, 6>(p, c, 6 * k));
  }
  out.add(velocity_biases_of(0), velocity_biases_of(0), block_of<9, 9>(p, v, v));
  out.add(calibration_of_camera(), velocity_biases_of(0), block_of<kCalibration, 9>(p, c, v));
  out.add(calibration_of_camera(), calibration_of_camera(), block_of<kCalibration, kCalibration>(p, c, c));
}
}  // namespace

double add_prior(const Window& w, NormalEquations* out) {
  const Prior& p = w.prior;
  if (p.frames == 0) return 0;
  const int dim = p.dim();
  double d[kPriorDim], Hd[kPriorDim], g[kPriorDim], cost = 0;
  prior_difference(w, d);
  using Symmetric = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Symmetric, Eigen::Aligned64, Eigen::OuterStride<kMarginalStride>> H(p.H[0], dim, dim);
  Eigen::Map<Eigen::VectorXd>(Hd, dim).noalias() =
      H.selfadjointView<Eigen::Lower>() * Eigen::Map<const Eigen::VectorXd>(d, dim);
  for (int i = 0; i < dim; ++i) {
    g[i] = p.b[i] - Hd[i];
    cost += d[i] * (Hd[i] - 2 * p.b[i]);
  }
  if (!out) return cost;
  for (int k = 0; k < p.frames; ++k) out->add(pose_of(k), Eigen::Map<const Vec6>(g + 6 * k));
  out->add(velocity_biases_of(0), Eigen::Map<const Vec9>(g + 6 * p.frames));
  out->add(calibration_of_camera(), Eigen::Map<const CalibrationTangent>(g + p.calibration_row()));
  add_information(p, *out);
  return cost;
}

void inflate(Prior& p, int at, std::span<const double> moved) {
  if (p.frames == 0) return;
  const int dim = p.dim();
  // with e = moved: (H^-1 + e e')^-1 = H - H e e' H / (1 + e'He); the mean H^-1 b stays
  double He[kPriorDim], eHe = 0, eb = 0;
  for (int i = 0; i < dim; ++i) {
    He[i] = 0;
    for (std::size_t k = 0; k < moved.size(); ++k) He[i] += p.H[i][at + static_cast<int>(k)] * moved[k];
  }
  for (std::size_t k = 0; k < moved.size(); ++k) {
    eHe += moved[k] * He[at + static_cast<int>(k)];
    eb += moved[k] * p.b[at + static_cast<int>(k)];
  }
  const double gain = 1 / (1 + eHe);
  for (int i = 0; i < dim; ++i) {
    p.b[i] -= gain * He[i] * eb;
    for (int j = 0; j < dim; ++j) p.H[i][j] -= gain * He[i] * He[j];
  }
}

namespace {
constexpr int kJoint = 15 + kCalibration;
using Joint = Eigen::Matrix<double, kJoint, kJoint>;

/// Scaled to a unit diagonal first: variances of biases and positions differ by many powers of ten. What has no
/// variance has no information.
template <class Covariance>
Covariance information_of(const Covariance& S) {
  const auto known = (S.diagonal().array() > 0).template cast<double>().matrix().eval();
  const auto unit = S.diagonal().cwiseMax(1e-18).cwiseSqrt().cwiseInverse().cwiseProduct(known).eval();
  Covariance correlation = unit.asDiagonal() * S * unit.asDiagonal();
  correlation.diagonal().array() += 1 + 1e-9 - known.array();
  const Covariance I = unit.asDiagonal() * correlation.llt().solve(Covariance::Identity()) * unit.asDiagonal();
  return 0.5 * (I + I.transpose());
}

/// What is left of the information on the calibration without that of its own prior, which is on its diagonal; nothing
/// where no more is known than that.
CalibrationCovariance without(const CalibrationTangent& own, const CalibrationCovariance& I) {
  const CalibrationTangent unit = (own.array() > 0).select(own, I.diagonal().cwiseMax(1e-18)).cwiseSqrt(),
                           per_unit = unit.cwiseInverse();
  CalibrationCovariance left = I;
  left.diagonal() -= own;
  const Eigen::SelfAdjointEigenSolver<CalibrationCovariance> axes(per_unit.asDiagonal() * left * per_unit.asDiagonal());
  const CalibrationTangent known = axes.eigenvalues().cwiseMax(0);
  left = axes.eigenvectors() * known.asDiagonal() * axes.eigenvectors().transpose();
  return unit.asDiagonal() * left * unit.asDiagonal();
}
}  // namespace

void set_prior(Window& w, const KnownJointly& known) {
  CalibrationCovariance calibration = known.calibration;
  CrossCovariance cross = known.cross;
  calibration.row(kTimeOffsetColumn).setZero();
  calibration.col(kTimeOffsetColumn).setZero();
  calibration(kTimeOffsetColumn, kTimeOffsetColumn) = known.time_offset_sigma * known.time_offset_sigma;
  cross.col(kTimeOffsetColumn).setZero();
  Joint S;
  S << known.P.topLeftCorner<15, 15>(), cross.topRows<15>(), cross.topRows<15>().transpose(), calibration;
  Joint I = information_of(S);
  const CalibrationTangent d = local(w.calibration_prior.configured, w.calibration);
  const CalibrationTangent own = (calibration.diagonal().array() > 0).select(known.own, 0);
  const CalibrationCovariance of_calibration = information_of(calibration);
  I.bottomRightCorner<kCalibration, kCalibration>() += without(own, of_calibration) - of_calibration;
  Prior& p = w.prior;
  p.frames = 1;
  for (int i = 0; i < kJoint; ++i) {
    for (int j = 0; j < kJoint; ++j) p.H[i][j] = I(i, j);
    p.b[i] = i < 15 ? 0 : own[i - 15] * d[i - 15];  // what was seen pulls as hard as its own prior did
  }
  p.x0[0] = w.at(0).x;
  p.c0 = w.calibration;
}

void set_initial_prior(Window& w, const InitialState& s, const CalibrationTangent& calibration_sigmas) {
  Prior& p = w.prior;
  p.frames = 1;
  const int dim = p.dim();
  for (int i = 0; i < dim; ++i) {
    std::memset(p.H[i], 0, sizeof p.H[i]);
    p.b[i] = 0;
  }
  auto information = [](double sigma) { return 1 / (sigma * sigma); };
  const NavState& x = w.at(0).x;
  // tilt and yaw are errors in the world; the tangent is in the body
  const Vec3 world(information(s.sigma_tilt), information(s.sigma_tilt), information(s.sigma_yaw));
  const Mat3 attitude = x.R.transpose() * world.asDiagonal() * x.R;
  for (int i = 0; i < 3; ++i) {
    p.H[i][i] = information(s.sigma_p);
    for (int j = 0; j < 3; ++j) p.H[3 + i][3 + j] = attitude(i, j);
    p.H[6 + i][6 + i] = information(s.sigma_v);
    p.H[9 + i][9 + i] = information(s.sigma_b_a);
    p.H[12 + i][12 + i] = information(s.sigma_b_g);
  }
  for (int c = 0; c < kCalibration; ++c)
    p.H[15 + c][15 + c] = calibration_sigmas[c] > 0 ? information(calibration_sigmas[c]) : 0;
  p.x0[0] = x;
  p.c0 = w.calibration;
}

}  // namespace epiline
