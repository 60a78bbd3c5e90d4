#pragma once
// Eigen's factorisations of matrices of any size, compiled once for all tests: each costs a compiler seconds.
#include <Eigen/Core>

namespace epiline::test {

/// Of a symmetric matrix, ascending.
Eigen::VectorXd eigenvalues(const Eigen::MatrixXd& A);
inline double least_eigenvalue(const Eigen::MatrixXd& A) { return eigenvalues(A)[0]; }
Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);
/// L with L L' = A; not a number where A is not positive definite.
Eigen::MatrixXd lower_factor(const Eigen::MatrixXd& A);
/// x with A x = b, of a positive definite A.
Eigen::VectorXd solve(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
/// J' H J.
Eigen::MatrixXd congruence(const Eigen::MatrixXd& H, const Eigen::MatrixXd& J);

}  // namespace epiline::test
