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
  double cost = 0;
};

/// The cheapest of the states tried. Where the parallax is small, rotation alone spoils a good reference bias; where
/// the baseline is, the linear system shrinks the velocity and turns gravity. No single guess is safe.
class Search {
 public:
  Search(const StartProblem& problem, StartPath& path) : problem_(problem), path_(path) {}

  void try_from(const StartState& state) {
    Candidate c{false, state, 0};
    c.valid = approach(problem_, c.state, path_, c.cost);
    if (c.valid && (!best_.valid || c.cost < best_.cost)) best_ = c;
  }
  const Candidate& best() const { return best_; }

 private:
  const StartProblem& problem_;
  StartPath& path_;
  Candidate best_;
};

/// Hovering: no velocity, gravity against the mean specific force.
StartState hovering(const StartProblem& problem, const StartPath& path, const Vec3& b_g) {
  StartState s;
  s.b_g = b_g;
  const Vec3& dv = path[problem.frames - 1].beta;
  if (dv.norm() > 0) s.g_0 = -kGravity * dv.normalized();
  return s;
}

Candidate search(const StartProblem& problem, StartPath& path, double& parallax_rad) {
  Search search(problem, path);
  Vec3 b_g = problem.b_g_ref;
  const bool rotation = solve_gyroscope_bias(problem, b_g);
  chain(problem, b_g, Vec3::Zero(), path);
  const StartState hover = hovering(problem, path, b_g);
  StartState linear = hover;
  if (solve_velocity_gravity(problem, path, linear, parallax_rad)) search.try_from(linear);
  search.try_from(hover);
  if (rotation) {
    chain(problem, problem.b_g_ref, Vec3::Zero(), path);
    StartState reference;
    reference.b_g = problem.b_g_ref;
    double ignored;
    if (solve_velocity_gravity(problem, path, reference, ignored)) search.try_from(reference);
  }
  return search.best();
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
  Candidate c = search(problem, path, guess.parallax_rad);
  const bool parallax = guess.parallax_rad >= limits.parallax_sigmas * problem.sigma_rad;
  RefinementFigures figures;
  if (!c.valid || !refine(problem, c.state, path, figures))
    return parallax ? StartRefusal::kSolverFailed : StartRefusal::kNoParallax;
  fill(problem, c.state, path, figures, guess);
  const std::optional<StartRefusal> refusal = judge(problem, limits, guess);
  return refusal && !parallax ? StartRefusal::kNoParallax : refusal;
}

}  // namespace epiline
