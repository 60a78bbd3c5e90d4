#pragma once
// Gyroscope bias from rotation alone: translation and depth are eliminated (Kneip and Lynen 2013, PNEC weights).
#include "estimator/initialise/start_problem.h"

namespace epiline {

/// Starts from and improves `b_g`, with the problem's prior. False: fewer than three usable frame pairs; `b_g` is then
/// unchanged.
[[nodiscard]] bool solve_gyroscope_bias(const StartProblem& problem, const StartKernels& kernels, Vec3& b_g);

}  // namespace epiline
