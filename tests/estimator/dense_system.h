#pragma once
// The solver's normal equations as one dense matrix, for comparison with Eigen's own factorisations.
#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <cmath>
#include <memory>

#include "estimator/solver/solver.h"

namespace epiline {

/// H x = b. Order: poses newest first, calibration, then (v, b) of the frames, oldest first.
struct DenseSystem {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

inline int velocity_row(int frames, int k) { return 6 * frames + kCalibration + 9 * k; }

/// To be called before factorise(), which works in place.
inline DenseSystem dense(const LinearSystem& s) {
  const int n = s.frames, poses = 6 * n + kCalibration, total = poses + 9 * n;
  DenseSystem d{Eigen::MatrixXd::Zero(total, total), Eigen::VectorXd::Zero(total)};
  auto set = [&](int i, int j, double x) { d.H(i, j) = d.H(j, i) = x; };
  for (int i = 0; i < poses; ++i) {
    d.b[i] = s.rhs_s[i];
    for (int j = i; j < poses; ++j) set(i, j, s.S[i][j]);
  }
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 9; ++i) {
      const int row = velocity_row(n, k) + i;
      d.b[row] = s.rhs_v[k][i];
      for (int j = 0; j < poses; ++j) set(row, j, s.P[k][i][j]);
      for (int j = i; j < 9; ++j) set(row, velocity_row(n, k) + j, s.D[k][i][j]);
      for (int j = 0; k > 0 && j < 9; ++j) set(row, velocity_row(n, k - 1) + j, s.C[k][i][j]);
    }
  return d;
}

/// Factors the solver's system (in place) and returns its step in the order above.
inline Eigen::VectorXd solve_with(InstructionSet set, LinearSystem& s, double damping = 0) {
  const int n = s.frames, poses = s.pose_dim();
  const EliminationKernels& kernels = elimination_kernels(set);
  const auto x = std::make_unique<StepColumns>();
  Eigen::VectorXd out = Eigen::VectorXd::Constant(poses + 9 * n, std::nan(""));
  if (!kernels.factorise(s, damping)) return out;
  kernels.forward(s, *x);
  kernels.back(s, *x);
  for (int i = 0; i < poses; ++i) out[i] = x->step_s[i];
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 9; ++i) out[velocity_row(n, k) + i] = x->step_v[k][i];
  return out;
}

/// Dense reference in long double, with the diagonal scaled to one first.
using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
struct DenseSolution {
  Eigen::VectorXd step;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd unit;  ///< sqrt of the diagonal of H: makes unknowns of different units comparable
};
inline DenseSolution solve_dense(const DenseSystem& d) {
  const Eigen::Matrix<long double, Eigen::Dynamic, 1> unit = d.H.diagonal().cast<long double>().cwiseSqrt();
  const LongMatrix scale = unit.cwiseInverse().asDiagonal();
  const LongMatrix A = scale * d.H.cast<long double>() * scale;
  const LongMatrix inverse = A.llt().solve(LongMatrix::Identity(A.rows(), A.cols()));
  const LongMatrix covariance = scale * inverse * scale;
  return {(covariance * d.b.cast<long double>()).cast<double>(), covariance.cast<double>(), unit.cast<double>()};
}

/// |S (a - b)| / |S b|, S the diagonal of `unit`.
inline double relative_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& unit) {
  return (unit.asDiagonal() * (a - b)).norm() / (unit.asDiagonal() * b).norm();
}

}  // namespace epiline
