#include "tests/estimator/dense_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

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

MatrixXd congruence(const MatrixXd& H, const MatrixXd& J) {
  const MatrixXd HJ = H * J;
  return J.transpose() * HJ;
}

}  // namespace epiline::test
