#pragma once
// What a solved frame shows besides its posterior. docs/derivations/health.md, "Quality".
#include "estimator/solver/solver.h"
#include "estimator/window/state.h"

namespace epiline {

/// By how much the images corrected what the IMU had predicted: |dv| and |dtheta| over the root of the trace of the
/// prediction's covariance `P`, the larger of the two. Its mean square is at most 1 if the covariance tells the truth.
double innovation(const NavState& predicted, const NewestCovariance& P, const NavState& solved) noexcept;

}  // namespace epiline
