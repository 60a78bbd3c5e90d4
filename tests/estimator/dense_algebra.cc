#include "tests/estimator/dense_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <random>

namespace epiline::test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd eigenvalues(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

MatrixXd inverse(const MatrixXd& A) { return A.inverse(); }

MatrixXd lower_factor(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return MatrixXd::Constant(A.rows(), A.cols(), std::nan(""));
  return factor.matrixL();
}

VectorXd solve(const MatrixXd& A, const VectorXd& b) { return A.ldlt().solve(b); }

MatrixXd product(const MatrixXd& A, const MatrixXd& B) { return A * B; }

MatrixXd congruence(const MatrixXd& H, const MatrixXd& J) { return product(J.transpose(), product(H, J)); }

double chi2(const VectorXd& e, const MatrixXd& A) { return e.dot(solve(A, e)); }

void add_equations(double weight, const MatrixXd& J, const VectorXd& r, MatrixXd& H, VectorXd& b) {
  H += weight * product(J.transpose(), J);
  b -= weight * product(J.transpose(), r);
}

MatrixXd random_covariance(int n, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  MatrixXd A(n, n + 5);
  for (double& x : A.reshaped()) x = normal(random);
  return product(A, A.transpose());
}

double relative_difference(const MatrixXd& A, const MatrixXd& B) { return (A - B).norm() / B.norm(); }

MatrixXd in_units(const MatrixXd& A, const VectorXd& unit) {
  const VectorXd scale = unit.cwiseInverse();
  return scale.asDiagonal() * A * scale.asDiagonal();
}

}  // namespace epiline::test
