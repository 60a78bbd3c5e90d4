#pragma once
// The IMU residual between two frames. Derivation: docs/derivations/imu.md; test: tests/estimator/factors/imu_test.cc.
#include "estimator/inertial/preintegration.h"
#include "estimator/window/state.h"

namespace epiline {

/// r: (r_p, r_theta, r_v, r_ba, r_bg), not whitened; J: d r / d (delta_i, delta_j), tangent order (p, theta, v, b_a,
/// b_g) each.
struct ImuResidual {
  Vec15 r;
  Eigen::Matrix<double, 15, 30> J;
};

/// Residual at (x_i, x_j). The Jacobian takes positions, rotations and velocities from the linearisation points l_i,
/// l_j (first estimates, docs/derivations/imu.md); pass the states themselves for the plain Jacobian.
void evaluate_imu(const Preintegration& z, const NavState& x_i, const NavState& x_j, const NavState& l_i,
                  const NavState& l_j, ImuResidual& out);

/// L^-1 (lower) with L L^T = C: whitens the residual and its Jacobian; constant while the interval is. False if and
/// only if C is not positive definite (an interval without samples); `L_inverse` is then unspecified.
bool square_root_information(const Preintegration& z, Mat15& L_inverse);

}  // namespace epiline
