#pragma once
// Joint nonlinear least squares over the state at frame 0: every pose follows from it through the IMU readings, every
// point is eliminated from its track. Derivation: docs/derivations/initialisation.md.
#include "estimator/initialise/start_path.h"

namespace epiline {

struct RefinementFigures {
  int tracks = 0;
  double cost = 0;         ///< robust, prior included, in squared sigmas
  double residual = 0;     ///< median length of a bearing's residual over that expected of Gaussian noise of one sigma
  double sigma_scale = 0;  ///< relative standard deviation of the size of the path
  StartMatrix covariance = StartMatrix::Zero();
};

/// Pulls `state` towards the nearest minimum from afar: wide kernels, some of the tracks. `cost`: robust, comparable
/// between states of one problem. False: the normal equations have no solution.
[[nodiscard]] bool approach(const StartProblem& problem, StartState& state, StartPath& path, double& cost);

/// Improves `state` in place, from nearby; `path` is left at the result. False: the normal equations have no solution.
[[nodiscard]] bool refine(const StartProblem& problem, StartState& state, StartPath& path, RefinementFigures& figures);

}  // namespace epiline
