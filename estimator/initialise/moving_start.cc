#include "estimator/initialise/moving_start.h"

#include <algorithm>
#include <cmath>

#include "estimator/initialise/gyroscope_bias.h"
#include "estimator/initialise/start_refinement.h"
#include "estimator/initialise/velocity_gravity.h"

namespace epiline {
namespace {

struct Candidate {
  bool valid = false;
  StartState state;
  double parallax_rad = 0;
  RefinementFigures figures;
};

Candidate from_bias(const StartProblem& problem, const Vec3& b_g, StartPath& path) {
  Candidate c;
  c.state.b_g = b_g;
  chain(problem, b_g, Vec3::Zero(), path);
  c.valid = solve_velocity_gravity(problem, path, c.state, c.parallax_rad) && refine(problem, c.state, path, c.figures);
  return c;
}

/// Rotation alone finds a large bias but, where the parallax is small, spoils a good reference: both are tried to the
/// end.
Candidate best_candidate(const StartProblem& problem, StartPath& path) {
  const Candidate reference = from_bias(problem, problem.b_g_ref, path);
  Vec3 b_g = problem.b_g_ref;
  if (!solve_gyroscope_bias(problem, b_g)) return reference;
  const Candidate rotation = from_bias(problem, b_g, path);
  return rotation.valid && (!reference.valid || rotation.figures.cost < reference.figures.cost) ? rotation : reference;
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

bool within(double value, double limit) { return value <= limit; }  // false for NaN

std::optional<StartRefusal> uncertain(const StartLimits& limits, const StartGuess& guess) {
  if (!within(guess.sigma_tilt, limits.sigma_tilt)) return StartRefusal::kTiltUncertain;
  if (!within(guess.sigma_scale, limits.sigma_scale)) return StartRefusal::kScaleUncertain;
  if (!within(guess.sigma_velocity, limits.sigma_velocity)) return StartRefusal::kVelocityUncertain;
  return std::nullopt;
}

std::optional<StartRefusal> judge(const StartProblem& problem, const StartLimits& limits, const StartGuess& guess) {
  if (!within(guess.residual, limits.residual)) return StartRefusal::kResidualTooLarge;
  if (!within((guess.state.b_g - problem.b_g_ref).norm(), limits.bias_sigmas * problem.b_g_sigma) ||
      !within(guess.state.b_a.norm(), limits.bias_sigmas * problem.b_a_sigma))
    return StartRefusal::kBiasImplausible;
  return uncertain(limits, guess);
}

}  // namespace

std::optional<StartRefusal> solve_moving_start(const StartProblem& problem, const StartLimits& limits,
                                               StartGuess& guess) {
  if (problem.frames < limits.frames || problem.frames > kStartFrames) return StartRefusal::kTooFewFrames;
  if (long_tracks(problem) < limits.tracks) return StartRefusal::kTooFewTracks;
  StartPath path;
  const Candidate c = best_candidate(problem, path);
  guess.parallax_rad = c.parallax_rad;
  const bool parallax = c.parallax_rad >= limits.parallax_sigmas * problem.sigma_rad;
  if (!c.valid) return parallax ? StartRefusal::kSolverFailed : StartRefusal::kNoParallax;
  chain(problem, c.state.b_g, c.state.b_a, path);
  fill(problem, c.state, path, c.figures, guess);
  const std::optional<StartRefusal> refusal = judge(problem, limits, guess);
  return refusal && !parallax ? StartRefusal::kNoParallax : refusal;
}

}  // namespace epiline
