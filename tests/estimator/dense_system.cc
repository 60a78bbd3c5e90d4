#include "tests/estimator/dense_system.h"

#include <cmath>
#include <memory>

namespace epiline::test {

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

Eigen::MatrixXd dense_prior(const Prior& p) {
  Eigen::MatrixXd H(p.dim(), p.dim());
  for (int i = 0; i < p.dim(); ++i)
    for (int j = 0; j < p.dim(); ++j) H(i, j) = p.H[i][j];
  return H;
}

Eigen::VectorXd dense_prior_rhs(const Prior& p) { return Eigen::Map<const Eigen::VectorXd>(p.b, p.dim()); }

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

DenseSolution solve_dense(const DenseSystem& d) {
  const auto n = static_cast<int>(d.b.size());
  Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic> A(n, n);
  DenseSolution s{Eigen::VectorXd::Zero(n), Eigen::MatrixXd(n, n), Eigen::VectorXd(n)};
  for (int i = 0; i < n; ++i) s.unit[i] = std::sqrt(d.H(i, i));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) A(j, i) = d.H(i, j) / (static_cast<long double>(s.unit[i]) * s.unit[j]);
  for (int k = 0; k < n; ++k) {  // Gauss and Jordan: the inverse in its place
    const long double pivot = A(k, k);
    A(k, k) = 1;
    for (int j = 0; j < n; ++j) A(j, k) /= pivot;
    for (int i = 0; i < n; ++i) {
      if (i == k) continue;
      const long double factor = A(k, i);
      A(k, i) = 0;
      for (int j = 0; j < n; ++j) A(j, i) -= factor * A(j, k);
    }
  }
  for (int i = 0; i < n; ++i) {
    long double step = 0;
    for (int j = 0; j < n; ++j) {
      const long double c = A(j, i) / (static_cast<long double>(s.unit[i]) * s.unit[j]);
      s.covariance(i, j) = static_cast<double>(c);
      step += c * d.b[j];
    }
    s.step[i] = static_cast<double>(step);
  }
  return s;
}

}  // namespace epiline::test
