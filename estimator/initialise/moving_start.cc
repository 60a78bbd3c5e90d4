#include "estimator/initialise/moving_start.h"

#include <algorithm>
#include <cmath>

#include "estimator/initialise/gyroscope_bias.h"
#include "estimator/initialise/start_refinement.h"
#include "estimator/initialise/velocity_gravity.h"

namespace epiline {
namespace {

constexpr double kFarFromHover = 12;     // sigmas of parallax
constexpr double kExplained = 1;         // cost over degrees of freedom, below which a state is not doubted
constexpr int kApproachIterations = 20;  // of one search, over all states it begins from
constexpr int kContinueIterations = 6;   // from the state of the last attempt
// Where no state explains the images, that of the last attempt is as good as long as its misfit has not grown by more.
constexpr double kAsGood = 1.1;
constexpr int kSearchAgain = 4;  // and every so many attempts all are tried again

struct Candidate {
  bool valid = false;
  StartState state;
  ApproachFigures figures;
  double misfit() const { return figures.cost / std::max(1, figures.freedom); }
  bool explains() const { return valid && misfit() < kExplained; }
};

/// The cheapest of the states tried. Where the parallax is small, rotation alone spoils a good reference bias; where
/// the baseline is, the linear system shrinks the velocity and turns gravity. No single guess is safe.
class Search {
 public:
  Search(const StartProblem& problem, PointElimination& points, StartPath& path)
      : problem_(problem), points_(points), path_(path) {}

  /// Begins at the state of the last attempt. True: it ends as well as that one did.
  bool go_on(const StartState& before, const StartMemory& memory);
  /// Finds the gyroscope bias, and leaves the path at it; returns the parallax, rad.
  double look();
  /// Directly after look(): tries states until one explains the images or the iterations are used up; `first`: which
  /// one to begin with.
  void run(int first);
  const Candidate& best() const { return best_; }
  double parallax_rad(const StartState& state);

 private:
  int approach_from(const StartState& state, int most);
  void try_from(const StartState& state);
  void try_reference();

  const StartProblem& problem_;
  PointElimination& points_;
  StartPath& path_;
  bool rotation_ = false, solved_ = false, far_ = false;
  StartState linear_, hover_;
  int left_ = kApproachIterations;
  Candidate best_;
};

/// Hovering, or flying on as is known: gravity against the mean specific force.
StartState hovering(const StartProblem& problem, const StartPath& path, const Vec3& b_g) {
  StartState s;
  s.v_0 = problem.v_0_ref;
  s.b_g = b_g;
  const Vec3& dv = path[problem.frames - 1].beta;
  if (dv.norm() > 0) s.g_0 = -kGravity * dv.normalized();
  return s;
}

double Search::parallax_rad(const StartState& state) {
  chain(problem_, state.b_g, state.b_a, path_);
  StartCameras camera;
  place_cameras(problem_, path_, state, camera);
  return points_.parallax(camera);
}

bool Search::go_on(const StartState& before, const StartMemory& memory) {
  approach_from(before, kContinueIterations);
  if (best_.explains()) return true;
  const bool due = memory.unexplained > 0 && memory.unexplained % kSearchAgain == 0;
  return best_.valid && !due && best_.misfit() < kAsGood * std::max(kExplained, memory.misfit);
}

double Search::look() {
  StartState s;
  s.b_g = problem_.b_g_ref;
  rotation_ = solve_gyroscope_bias(problem_, points_.kernels(), s.b_g);
  const double parallax = parallax_rad(s);
  linear_ = hover_ = hovering(problem_, path_, s.b_g);
  far_ = problem_.v_0_ref.isZero() && parallax >= kFarFromHover * problem_.sigma_rad;
  return parallax;
}

/// Returns the iterations it took.
int Search::approach_from(const StartState& state, int most) {
  Candidate c{false, state, {}};
  c.valid = approach(problem_, points_, c.state, path_, most, c.figures);
  if (c.valid && (!best_.valid || c.figures.cost < best_.figures.cost)) best_ = c;
  return std::max(1, c.figures.iterations);
}

void Search::try_from(const StartState& state) {
  if (left_ > 0 && !best_.explains()) left_ -= approach_from(state, left_);
}

void Search::try_reference() {
  if (!rotation_ || left_ <= 0 || best_.explains()) return;
  chain(problem_, problem_.b_g_ref, Vec3::Zero(), path_);
  StartState reference;
  reference.b_g = problem_.b_g_ref;
  if (solve_velocity_gravity(problem_, points_, path_, reference)) try_from(reference);
}

/// At little parallax every state explains the images, and hovering comes first: the linear system would lead into a
/// valley of wrong velocities.
void Search::run(int first) {
  solved_ = solve_velocity_gravity(problem_, points_, path_, linear_);
  for (int n = 0; n < 3; ++n) {
    switch ((first + n) % 3) {
      case 0:
        if (!far_)
          try_from(hover_);
        else if (solved_)
          try_from(linear_);
        break;
      case 1:
        if (far_)
          try_from(hover_);
        else if (solved_)
          try_from(linear_);
        break;
      default:
        try_reference();
    }
  }
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
  guess.sigma_rad = guess.noise_rad = problem.sigma_rad;
  guess.pull = figures.pull / std::max(1e-6, figures.residual * figures.residual);
  guess.sigma_scale = figures.sigma_scale;
  guess.sigma_velocity = std::sqrt(figures.covariance.topLeftCorner<3, 3>().trace());
  guess.sigma_tilt = std::sqrt(figures.covariance(3, 3) + figures.covariance(4, 4));
  guess.sigma_b_g = std::sqrt(figures.covariance.block<3, 3>(5, 5).trace());
}

bool within(double value, double limit) { return value <= limit; }  // false for NaN

std::optional<StartRefusal> uncertain(const StartLimits& limits, const StartGuess& guess) {
  if (!within(limits.parallax_patterns * guess.pattern_rad(), guess.parallax_rad)) return StartRefusal::kScaleUncertain;
  if (!within(guess.sigma_scale, limits.sigma_scale)) return StartRefusal::kScaleUncertain;
  if (!within(guess.sigma_tilt, limits.sigma_tilt)) return StartRefusal::kTiltUncertain;
  if (!within(guess.sigma_velocity, std::max(limits.sigma_velocity, limits.sigma_scale * guess.state.v_0.norm())))
    return StartRefusal::kVelocityUncertain;
  return std::nullopt;
}

std::optional<StartRefusal> judge(const StartProblem& problem, const StartLimits& limits, const StartGuess& guess) {
  if (!within(guess.residual, limits.residual)) return StartRefusal::kResidualTooLarge;
  if (guess.sigma_rad > problem.sigma_rad && !within(guess.pull, limits.pull)) return StartRefusal::kResidualTooLarge;
  if (!within((guess.state.b_g - problem.b_g_ref).norm(), limits.bias_sigmas * problem.b_g_sigma) ||
      !within(guess.state.b_a.norm(), limits.bias_sigmas * problem.b_a_sigma))
    return StartRefusal::kBiasImplausible;
  return uncertain(limits, guess);
}

/// Refines the state. The residuals give the noise of the bearings, if they are large, or small enough to claim more.
/// Large ones are noise only if they have no pattern: no frame's pose would leave the path if it could.
bool refine_with_noise(const StartProblem& problem, const StartLimits& limits, PointElimination& points,
                       StartState& state, StartPath& path, StartGuess& guess) {
  RefinementFigures figures;
  if (!refine(problem, points, state, path, figures)) return false;
  fill(problem, state, path, figures, guess);
  const double noise = std::max(limits.noise_least, guess.residual);
  if (problem.frames < limits.noise_frames || !within(noise, limits.noise_most)) return true;
  if (noise >= 1 && within(noise, limits.residual)) {
    if (within(guess.pull, limits.pull)) guess.noise_rad *= noise;
    return true;
  }
  StartProblem seen = problem;
  seen.sigma_rad = problem.sigma_rad * noise;
  if (!refine(seen, points, state, path, figures)) return false;
  fill(seen, state, path, figures, guess);
  return true;
}

void remember(const StartProblem& problem, const StartGuess& guess, StartMemory& memory) {
  memory.frames = problem.frames;
  memory.id = problem.id;
  for (int k = 0; k < problem.frames; ++k)
    memory.state[k] = {guess.R[k].transpose() * guess.v[k], guess.R[k].transpose() * guess.state.g_0, guess.state.b_g,
                       guess.state.b_a};
}

/// Goes on from the last attempt where it can, else searches.
std::optional<StartRefusal> attempt(const StartProblem& problem, const StartLimits& limits, PointElimination& points,
                                    StartMemory& memory, StartGuess& guess) {
  StartPath path;
  Search search(problem, points, path);
  const StartState* before = memory.at(problem.id[0]);
  guess.continued = false;
  guess.parallax_rad = before != nullptr ? search.parallax_rad(*before) : search.look();
  if (!within(limits.least_parallax_sigmas * problem.sigma_rad, guess.parallax_rad)) return StartRefusal::kNoParallax;
  if (before != nullptr) guess.continued = search.go_on(*before, memory);
  if (!guess.continued) {
    if (before != nullptr) guess.parallax_rad = search.look();
    search.run(memory.unexplained);
    memory.misfit = search.best().misfit();
  }
  memory.unexplained = search.best().explains() ? 0 : memory.unexplained + 1;
  memory.frames = 0;
  StartState state = search.best().state;
  if (!search.best().valid || !refine_with_noise(problem, limits, points, state, path, guess))
    return StartRefusal::kSolverFailed;
  const std::optional<StartRefusal> refusal = judge(problem, limits, guess);
  if (refusal != StartRefusal::kBiasImplausible) remember(problem, guess, memory);
  return refusal;
}

}  // namespace

const StartState* StartMemory::at(std::uint64_t frame) const {
  for (int k = 0; k < frames && frame != 0; ++k)
    if (id[k] == frame) return &state[k];
  return nullptr;
}

std::optional<StartRefusal> solve_moving_start(const StartProblem& problem, const StartLimits& limits,
                                               PointElimination& points, StartMemory& memory, StartGuess& guess) {
  guess.moved = 1;
  if (problem.frames < limits.frames || problem.frames > kStartFrames) return StartRefusal::kTooFewFrames;
  if (long_tracks(problem) < limits.tracks) return StartRefusal::kTooFewTracks;
  points.collect(problem);
  const StartState* last = memory.at(problem.id[0]);
  const std::optional<Vec3> v_0 = last != nullptr ? std::optional(last->v_0) : std::nullopt;
  const int unexplained = memory.unexplained;
  std::optional<StartRefusal> refusal = attempt(problem, limits, points, memory, guess);
  if (!refusal && guess.continued) {
    // Going on may end in another minimum than a search, one that later images refute: only a search begins a flight.
    memory.frames = 0;
    memory.unexplained = unexplained;
    refusal = attempt(problem, limits, points, memory, guess);
  }
  if (v_0) guess.moved = (guess.state.v_0 - *v_0).norm() / std::max(1e-9, guess.state.v_0.norm());
  return refusal;
}

}  // namespace epiline
