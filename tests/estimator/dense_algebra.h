#pragma once
// Algebra with matrices of any size, compiled once for all tests: in each source, such a product or factorisation costs
// a compiler seconds.
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
Eigen::MatrixXd product(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);
/// J' H J.
Eigen::MatrixXd congruence(const Eigen::MatrixXd& H, const Eigen::MatrixXd& J);
/// e' A^-1 e, of a positive definite A.
double chi2(const Eigen::VectorXd& e, const Eigen::MatrixXd& A);
/// H += weight J' J, b -= weight J' r.
void add_equations(double weight, const Eigen::MatrixXd& J, const Eigen::VectorXd& r, Eigen::MatrixXd& H,
                   Eigen::VectorXd& b);
/// A random covariance of n numbers, all of them correlated.
Eigen::MatrixXd random_covariance(int n, unsigned seed);
/// |A - B| / |B|.
double relative_difference(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);
/// A with its rows and columns divided by `unit`.
Eigen::MatrixXd in_units(const Eigen::MatrixXd& A, const Eigen::VectorXd& unit);

}  // namespace epiline::test
