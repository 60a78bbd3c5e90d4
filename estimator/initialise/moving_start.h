#pragma once
// A start in motion, without a map and without known biases: gyroscope bias from rotation alone, velocity and gravity
// from one linear system, then both, with the accelerometer bias, from a joint least squares. Derivation:
// docs/derivations/initialisation.md.
#include <optional>

#include "estimator/config.h"
#include "estimator/initialise/start_problem.h"
#include "estimator/statistics.h"

namespace epiline {

/// Beyond these a guess is refused. Deviations are those of image noise and biases; noise within the IMU readings is
/// not in them.
struct StartLimits {
  int frames = 4;               ///< fewer are refused
  int tracks = 15;              ///< of at least three views
  double parallax_sigmas = 4;   ///< with less StartGuess::parallax_rad a refusal is for want of parallax
  double residual = 1.5;        ///< StartGuess::residual
  double sigma_scale = 0.12;    ///< relative
  double sigma_velocity = 0.3;  ///< m/s
  double sigma_tilt = 0.06;     ///< rad
  double bias_sigmas = 10;      ///< distance of either bias from its prior, in the prior's sigmas
};

/// The state at every frame, in B_0, and how well it is known.
struct StartGuess {
  StartState state;
  std::array<Vec3, kStartFrames> p, v;
  std::array<Mat3, kStartFrames> R;  ///< B_0 <- B_k
  int tracks = 0;
  double parallax_rad = 0;  ///< median over the tracks of the widest angle between two bearings, rotation removed
  double residual = 0;      ///< typical bearing residual over the given sigma; 1 for Gaussian noise of that size
  double sigma_velocity = 0, sigma_tilt = 0, sigma_scale = 0, sigma_b_g = 0;  ///< m/s, rad, relative, rad/s
};

/// Fixed memory (about 64 kB of stack), a few milliseconds. Empty: `guess` is good; otherwise why not, and `guess`
/// holds what was found so far.
[[nodiscard]] std::optional<StartRefusal> solve_moving_start(const StartProblem& problem, const StartLimits& limits,
                                                             StartGuess& guess);

}  // namespace epiline
