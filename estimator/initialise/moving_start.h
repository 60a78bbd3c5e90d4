#pragma once
// A start in motion, without a map and without known biases: gyroscope bias from rotation alone, velocity and gravity
// from one linear system, then both, with the accelerometer bias, from a joint least squares. Derivation:
// docs/derivations/initialisation.md.
#include <cmath>
#include <optional>

#include "estimator/config.h"
#include "estimator/initialise/start_point.h"
#include "estimator/statistics.h"

namespace epiline {

/// Limits beyond which a guess is refused. The deviations are due to image noise and biases; they do not include the
/// noise of the IMU samples.
struct StartLimits {
  int frames = 4;                          ///< fewer are refused
  int tracks = 15;                         ///< of at least three views
  double least_parallax_sigmas = 2;        ///< with less no start is tried, because it is noise of the bearings
  double parallax_patterns = 6;            ///< StartGuess::parallax_rad over StartGuess::pattern_rad()
  double residual = 1.5;                   ///< StartGuess::residual
  double noise_least = 1, noise_most = 4;  ///< StartGuess::sigma_rad over StartProblem::sigma_rad
  int noise_frames = 10;        ///< with fewer the noise given is assumed: a wrong model shows no pattern yet
  double pull = 1.3;            ///< StartGuess::pull, where more noise than given is assumed
  double sigma_scale = 0.12;    ///< relative
  double sigma_velocity = 0.3;  ///< m/s; at speed sigma_scale of it, as there both are one
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
  double residual = 0;      ///< typical bearing residual over sigma_rad; 1 for Gaussian noise of that size
  double sigma_rad = 0;     ///< bearing noise assumed in the end: the one given, or what the residuals show
  double noise_rad = 0;     ///< bearing noise for what comes after: also where the residuals show a little more
  double pull = 0;          ///< RefinementFigures::pull over the squared residual: of errors that have a pattern
  /// How far residuals would move if they were of that pattern alone.
  double pattern_rad() const { return std::sqrt(pull) * residual * sigma_rad; }
  bool continued = false;  ///< refused where going on from the last attempt ended, without a search
  double moved = 1;        ///< change of the velocity since the last attempt, relative; 1: there was none
  double sigma_velocity = 0, sigma_tilt = 0, sigma_scale = 0, sigma_b_g = 0;  ///< m/s, rad, relative, rad/s
};

/// What an attempt leaves for the next one.
struct StartMemory {
  int frames = 0;  ///< of the state that it ended with; 0: none
  std::array<std::uint64_t, kStartFrames> id{};
  std::array<StartState, kStartFrames> state;  ///< at each of these frames, in its own body frame
  double misfit = 0;                           ///< cost over degrees of freedom of the state that the last search chose
  int unexplained = 0;                         ///< attempts in a row in which no state explained the images

  /// The state at a frame. Null: the last attempt did not contain that frame.
  const StartState* at(std::uint64_t frame) const;
};

/// Fixed memory, bounded work: at most kContinueIterations and kApproachIterations with a third of the tracks, and four
/// refinements. `points` is work space. Empty: `guess` is good. Otherwise the reason of the refusal, and `guess` holds
/// partial results.
[[nodiscard]] std::optional<StartRefusal> solve_moving_start(const StartProblem& problem, const StartLimits& limits,
                                                             PointElimination& points, StartMemory& memory,
                                                             StartGuess& guess);

}  // namespace epiline
