#pragma once
// Joint nonlinear least squares over the state at frame 0: every pose follows from it through the IMU readings, every
// point is eliminated from its track. Derivation: docs/derivations/initialisation.md.
#include "estimator/initialise/start_point.h"

namespace epiline {

struct RefinementFigures {
  int tracks = 0;
  double cost = 0;      ///< robust, prior included, in squared sigmas
  double residual = 0;  ///< median length of a bearing's residual over that expected of Gaussian noise of one sigma
  double pull = 0;  ///< mean score of the frames' poses, each free by itself: at most 1 for independent bearing errors
  double sigma_scale = 0;  ///< relative standard deviation of the size of the path
  StartMatrix covariance = StartMatrix::Zero();
};

struct ApproachFigures {
  double cost = 0;  ///< robust, comparable between states of one problem; near `freedom` for Gaussian noise
  int freedom = 0;
  int iterations = 0;  ///< that it took
};

/// Pulls `state` towards the nearest minimum from afar: wide kernels, some of the tracks. `points` has collected those
/// of the problem. `most`: iterations. False: the normal equations have no solution.
[[nodiscard]] bool approach(const StartProblem& problem, PointElimination& points, StartState& state, StartPath& path,
                            int most, ApproachFigures& figures);

/// Improves `state` in place, from nearby; `path` is left at the result. False: the normal equations have no solution.
[[nodiscard]] bool refine(const StartProblem& problem, PointElimination& points, StartState& state, StartPath& path,
                          RefinementFigures& figures);

}  // namespace epiline
