#pragma once
// Evidence for health from a solved frame, besides its posterior. docs/derivations/health.md, "Quality".
#include "estimator/inertial/nav_state.h"

namespace epiline {

/// Innovation: how far the images corrected the IMU's prediction, |dv| and |dtheta| divided by the square root of the
/// trace of the prediction's covariance `P`; the larger of the two. Its mean square is at most 1 if the covariance is
/// consistent.
double innovation(const NavState& predicted, const StateCovariance& P, const NavState& solved) noexcept;

/// Standard deviation of the velocity in the body's axes, largest axis, m/s. In the world's axes an unknown heading
/// would count as an unknown speed.
double sigma_velocity(const NavState& x, const StateCovariance& P) noexcept;
/// Standard deviation of the tilt, the larger of both axes, rad.
double sigma_tilt(const NavState& x, const StateCovariance& P) noexcept;

}  // namespace epiline
