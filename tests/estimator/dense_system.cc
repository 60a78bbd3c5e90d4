#include "tests/estimator/dense_system.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <memory>

namespace epiline {

DenseSystem dense(const LinearSystem& s) {
  const int n = s.frames, dim = dense_dim(n), total = 15 * n + kCalibration;
  DenseSystem d{Eigen::MatrixXd::Zero(total, total), Eigen::VectorXd::Zero(total)};
  auto set = [&](int i, int j, double x) { d.H(i, j) = d.H(j, i) = x; };
  for (int i = 0; i < dim; ++i) {
    d.b[i] = s.rhs_s[i];
    for (int j = i; j < dim; ++j) set(i, j, s.S[i][j]);
  }
  for (int k = 0; k < n - 1; ++k)
    for (int i = 0; i < 9; ++i) {
      const int row = velocity_row(n, k) + i;
      d.b[row] = s.rhs_v[k][i];
      for (int j = first_met(k); j < dim; ++j) set(row, j, s.P[k][i][j]);
      for (int j = i; j < 9; ++j) set(row, velocity_row(n, k) + j, s.D[k][i][j]);
      for (int j = 0; k > 0 && j < 9; ++j) set(row, velocity_row(n, k - 1) + j, s.C[k][i][j]);
    }
  return d;
}

Eigen::VectorXd solve_with(InstructionSet set, LinearSystem& s, double damping) {
  const int n = s.frames, dim = dense_dim(n);
  const EliminationKernels& kernels = elimination_kernels(set);
  const auto x = std::make_unique<WindowStep>();
  Eigen::VectorXd out = Eigen::VectorXd::Constant(15 * n + kCalibration, std::nan(""));
  if (!kernels.factorise(s, damping)) return out;
  kernels.back(s, *x);
  for (int i = 0; i < dim; ++i) out[i] = x->s[i];
  for (int k = 0; k < n - 1; ++k)
    for (int i = 0; i < 9; ++i) out[velocity_row(n, k) + i] = x->v[k][i];
  return out;
}

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

DenseSolution solve_dense(const DenseSystem& d) {
  const Eigen::Matrix<long double, Eigen::Dynamic, 1> unit = d.H.diagonal().cast<long double>().cwiseSqrt();
  const LongMatrix scale = unit.cwiseInverse().asDiagonal();
  const LongMatrix A = scale * d.H.cast<long double>() * scale;
  const LongMatrix inverse = A.llt().solve(LongMatrix::Identity(A.rows(), A.cols()));
  const LongMatrix covariance = scale * inverse * scale;
  return {(covariance * d.b.cast<long double>()).cast<double>(), covariance.cast<double>(), unit.cast<double>()};
}

}  // namespace epiline
