#include "estimator/initialise/moving_start.h"

#include <algorithm>
#include <cmath>

#include "estimator/initialise/gyroscope_bias.h"
#include "estimator/initialise/start_refinement.h"
#include "estimator/initialise/velocity_gravity.h"

namespace epiline {
namespace {

struct Hypothesis {
  bool valid = false;
  StartState state;
  LinearFigures figures;
  double cost = 0;
};

Hypothesis from_bias(const StartProblem& problem, const Vec3& b_g, StartPath& path) {
  Hypothesis h;
  h.state.b_g = b_g;
  chain(problem, b_g, Vec3::Zero(), path);
  h.valid = solve_velocity_gravity(problem, path, h.state, h.figures);
  if (h.valid) h.cost = coarse_cost(problem, h.state, path);
  return h;
}

/// Rotation alone finds the bias or, where parallax is small and the field narrow, spoils a good reference: the images
/// choose.
Hypothesis linear_start(const StartProblem& problem, StartPath& path) {
  Hypothesis reference = from_bias(problem, problem.b_g_ref, path);
  Vec3 b_g = problem.b_g_ref;
  if (!solve_gyroscope_bias(problem, b_g)) return reference;
  const Hypothesis rotation = from_bias(problem, b_g, path);
  return rotation.valid && (!reference.valid || rotation.cost < reference.cost) ? rotation : reference;
}

int long_tracks(const StartProblem& problem) {
  return static_cast<int>(
      std::count_if(problem.tracks.begin(), problem.tracks.end(), [](const StartTrack& t) { return t.count >= 3; }));
}

void fill(const StartProblem& problem, const StartState& state, const StartPath& path, const RefinementFigures& figures,
          StartGuess& guess) {
  guess.state = state;
  for (int k = 0; k < problem.frames; ++k) {
    guess.p[k] = path[k].position(state);
    guess.v[k] = path[k].velocity(state);
    guess.R[k] = path[k].R;
  }
  guess.tracks = figures.tracks;
  guess.residual = figures.residual;
  guess.sigma_scale = figures.sigma_scale;
  guess.sigma_velocity = std::sqrt(figures.covariance.topLeftCorner<3, 3>().trace());
  guess.sigma_tilt = std::sqrt(figures.covariance(3, 3) + figures.covariance(4, 4));
  guess.sigma_b_g = std::sqrt(figures.covariance.block<3, 3>(5, 5).trace());
}

bool no_parallax(const StartProblem& problem, const StartLimits& limits, const StartGuess& guess) {
  return guess.parallax_rad < limits.parallax_sigmas * problem.sigma_rad;
}

std::optional<StartRefusal> judge(const StartProblem& problem, const StartLimits& limits, const StartGuess& guess) {
  const auto within = [](double value, double limit) { return value <= limit; };  // false for NaN
  if (!within(guess.residual, limits.residual)) return StartRefusal::kResidualTooLarge;
  if (!within((guess.state.b_g - problem.b_g_ref).norm(), limits.bias_sigmas * problem.b_g_sigma) ||
      !within(guess.state.b_a.norm(), limits.bias_sigmas * problem.b_a_sigma))
    return StartRefusal::kBiasImplausible;
  if (!within(guess.sigma_tilt, limits.sigma_tilt)) return StartRefusal::kTiltUncertain;
  if (!within(guess.sigma_scale, limits.sigma_scale))
    return no_parallax(problem, limits, guess) ? StartRefusal::kNoParallax : StartRefusal::kScaleUncertain;
  if (!within(guess.sigma_velocity, limits.sigma_velocity)) return StartRefusal::kVelocityUncertain;
  return std::nullopt;
}

}  // namespace

std::optional<StartRefusal> solve_moving_start(const StartProblem& problem, const StartLimits& limits,
                                               StartGuess& guess) {
  if (problem.frames < limits.frames || problem.frames > kStartFrames) return StartRefusal::kTooFewFrames;
  if (long_tracks(problem) < limits.tracks) return StartRefusal::kTooFewTracks;
  StartPath path;
  Hypothesis start = linear_start(problem, path);
  guess.parallax_rad = start.figures.parallax_rad;
  if (!start.valid)
    return no_parallax(problem, limits, guess) ? StartRefusal::kNoParallax : StartRefusal::kSolverFailed;
  RefinementFigures figures;
  if (!refine(problem, start.state, path, figures)) return StartRefusal::kSolverFailed;
  fill(problem, start.state, path, figures, guess);
  return judge(problem, limits, guess);
}

}  // namespace epiline
