#pragma once
// What a solved frame shows besides its posterior. docs/derivations/health.md, "Quality".
#include "estimator/inertial/nav_state.h"

namespace epiline {

/// By how much the images corrected what the IMU had predicted: |dv| and |dtheta| over the root of the trace of the
/// prediction's covariance `P`, the larger of the two. Its mean square is at most 1 if the covariance tells the truth.
double innovation(const NavState& predicted, const StateCovariance& P, const NavState& solved) noexcept;

/// Of the velocity as the body sees it, largest axis, m/s. In the world's axes an unknown heading would count as an
/// unknown speed.
double sigma_velocity(const NavState& x, const StateCovariance& P) noexcept;
/// Of the attitude across gravity, the larger of both axes, rad.
double sigma_tilt(const NavState& x, const StateCovariance& P) noexcept;

}  // namespace epiline
