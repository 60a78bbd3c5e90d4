#pragma once
// The solver's normal equations as one dense matrix, for comparison with Eigen's own factorisations.
#include <Eigen/Core>

#include "estimator/factors/prior.h"
#include "estimator/solver/solver.h"

namespace epiline::test {

/// H x = b. Order: the dense part as in LinearSystem, then (v, b) of the frames but the newest, oldest first.
struct DenseSystem {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};

inline int velocity_row(int frames, int k) {
  return k < frames - 1 ? dense_dim(frames) + 9 * k : newest_velocity_column(frames);
}

/// To be called before factorise(), which works in place.
DenseSystem dense(const LinearSystem& s);

Eigen::MatrixXd dense_prior(const Prior& prior);
Eigen::VectorXd dense_prior_rhs(const Prior& prior);

/// Factors the solver's system (in place) and returns its step in the order above.
Eigen::VectorXd solve_with(InstructionSet set, LinearSystem& s, double damping = 0);

/// Dense reference in long double, with the diagonal scaled to one first.
struct DenseSolution {
  Eigen::VectorXd step;
  Eigen::MatrixXd covariance;
  Eigen::VectorXd unit;  ///< sqrt of the diagonal of H: makes unknowns of different units comparable
};
DenseSolution solve_dense(const DenseSystem& d);

/// |S (a - b)| / |S b|, S the diagonal of `unit`.
inline double relative_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& unit) {
  return unit.cwiseProduct(a - b).norm() / unit.cwiseProduct(b).norm();
}

}  // namespace epiline::test
