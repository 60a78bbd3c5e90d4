#pragma once
// Velocity and gravity at frame 0 from one linear system without points (LiGT rows, Cai et al. 2023; DRT, He et al.
// 2023).
#include "estimator/initialise/start_point.h"

namespace epiline {

/// Fills state.v_0 and state.g_0 (|g_0| = kGravity exactly) for the rotations and biases of `path`. `points` has
/// collected the tracks of the problem. False: no solution.
[[nodiscard]] bool solve_velocity_gravity(const StartProblem& problem, const PointElimination& points,
                                          const StartPath& path, StartState& state);

}  // namespace epiline
