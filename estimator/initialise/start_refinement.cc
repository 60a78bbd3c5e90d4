#include "estimator/initialise/start_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/initialise/start_point.h"

namespace epiline {
namespace {

struct Stage {
  double kernel;   // Cauchy scale, in sigmas
  int every;       // of so many tracks one is used
  int iterations;  // at most
};
// A wide kernel pulls from afar, and for that a third of the tracks will do; the last one forgets gross errors.
constexpr std::array<Stage, 2> kApproach = {{{32, 3, 8}, {8, 3, 8}}};
constexpr Stage kFinal = {2, 1, 8};
constexpr double kSpeedSigma = 10;   // m/s: only keeps the system regular
constexpr int kFirstInnerSteps = 2;  // of a point from its closed form; from where it was last, one is enough
constexpr double kConverged = 1e-4;  // share of the cost: a step that gains, or promises, less is the last

using Points = std::array<StartPoint, kStartTracks>;

void place_cameras(const StartProblem& problem, const StartPath& path, const StartState& s, StartViews& view) {
  for (int k = 0; k < problem.frames; ++k) {
    StartView& v = view[k];
    v.T = path[k].T;
    v.p = path[k].position(s);
    v.R = path[k].R * problem.R_BC;
    v.c = v.p + path[k].R * problem.p_BC;
    v.p_b = path[k].alpha_b;
    v.dphi = path[k].rotation_rows();
  }
}

void add_prior(const StartProblem& problem, const StartState& s, StartNormal& n) {
  StartVector information, error = StartVector::Zero();
  information << Vec3::Constant(1 / (kSpeedSigma * kSpeedSigma)), Vec2::Zero(),
      Vec3::Constant(1 / (problem.b_g_sigma * problem.b_g_sigma)),
      Vec3::Constant(1 / (problem.b_a_sigma * problem.b_a_sigma));
  error.head<3>() = s.v_0;
  error.segment<3>(5) = s.b_g - problem.b_g_ref;
  error.tail<3>() = s.b_a;
  n.H.diagonal() += information;
  n.b -= information.cwiseProduct(error);
  n.cost += error.dot(information.cwiseProduct(error));
}

int used_tracks(const StartProblem& problem) {
  return std::min<int>(kStartTracks, static_cast<int>(problem.tracks.size()));
}

/// The least squares of one problem, with the points where they were found last.
class Descent {
 public:
  Descent(const StartProblem& problem, StartPath& path) : problem_(problem), path_(path) {}
  /// Damped Gauss-Newton of one stage. False if the normal equations cannot be solved.
  bool descend(const Stage& stage, int most, StartState& state);
  int iterations() const { return iterations_; }
  double pull() const { return pull_; }
  const StartNormal& normal() const { return now_; }
  /// Degrees of freedom of the last linearisation.
  int freedom() const { return freedom_; }
  const StartViews& view() const { return view_; }
  double typical_residual(int& tracks) const;
  void place(const StartState& state) {
    chain(problem_, state.b_g, state.b_a, path_);
    place_cameras(problem_, path_, state, view_);
  }

 private:
  void linearise(const StartState& s, const Stage& stage, StartNormal& n);
  /// The last linearisation is the one to go on from.
  void accept() { std::swap(point_, trial_point_); }

  const StartProblem& problem_;
  StartPath& path_;
  StartViews view_;
  Points point_buffer_[2];  ///< at the state accepted; as tried
  Points *point_ = &point_buffer_[0], *trial_point_ = &point_buffer_[1];
  StartNormal now_;
  int freedom_ = 0, iterations_ = 0;
  double pull_ = 0;
};

void Descent::linearise(const StartState& s, const Stage& stage, StartNormal& n) {
  place(s);
  const Eigen::Matrix<double, 3, 2> gravity = kGravity * gravity_basis(s.g_0);
  StartSums sum(problem_.frames);
  add_prior(problem_, s, sum.total);
  freedom_ = -kStartDof;
  for (int t = 0; t < used_tracks(problem_); t += stage.every) {
    const StartTrack& track = problem_.tracks[static_cast<std::size_t>(t)];
    if (track.count < 2) continue;
    const StartPoint& last = (*point_)[static_cast<std::size_t>(t)];
    PointElimination point(track, view_, problem_.sigma_rad, stage.kernel);
    point.solve(last, last.rho > 0 ? 1 : kFirstInnerSteps);
    point.add_to(gravity, sum);
    (*trial_point_)[static_cast<std::size_t>(t)] = point.point();
    freedom_ += 2 * track.count - 3;
  }
  if (stage.every == 1) pull_ = sum.mean_score(problem_.frames);
  sum.finish(view_, problem_.frames, gravity);
  n = sum.total;
}

bool Descent::descend(const Stage& stage, int most, StartState& state) {
  StartNormal trial;
  linearise(state, stage, now_);
  accept();
  double damping = 1e-6;
  for (int n = 0; n < std::min(most, stage.iterations); ++n) {
    StartMatrix H = now_.H.selfadjointView<Eigen::Upper>();
    H.diagonal() *= 1 + damping;
    const StartVector step = H.ldlt().solve(now_.b);
    if (!step.allFinite()) return false;
    if (step.dot(now_.b) < kConverged * now_.cost) break;
    const StartState candidate = moved(state, step);
    linearise(candidate, stage, trial);
    ++iterations_;
    if (!(trial.cost <= now_.cost)) {
      damping = std::max(1e-4, damping * 30);
      continue;
    }
    const double gain = now_.cost - trial.cost;
    accept();
    state = candidate;
    now_ = trial;
    damping = std::max(1e-9, 0.1 * damping);
    if (gain < kConverged * now_.cost) break;
  }
  return true;
}

/// Median of the residual lengths over 1.177, the median length of two unit Gaussians.
double Descent::typical_residual(int& tracks) const {
  std::array<double, kStartTracks> length;
  tracks = 0;
  for (int t = 0; t < used_tracks(problem_); ++t) {
    const StartTrack& track = problem_.tracks[static_cast<std::size_t>(t)];
    if (track.count < 3) continue;
    PointElimination point(track, view_, problem_.sigma_rad, kFinal.kernel);
    point.solve((*point_)[static_cast<std::size_t>(t)], 1);
    std::array<double, kStartFrames> s;
    for (int q = 0; q < track.count; ++q) s[q] = point.residual2(q);
    std::nth_element(s.begin(), s.begin() + track.count / 2, s.begin() + track.count);
    // 2 n - 3 of 2 n degrees of freedom are left after the point is fitted
    length[tracks++] = std::sqrt(s[track.count / 2] * (2.0 * track.count) / (2.0 * track.count - 3));
  }
  if (tracks == 0) return 0;
  std::nth_element(length.begin(), length.begin() + tracks / 2, length.begin() + tracks);
  return length[tracks / 2] / 1.177;
}

/// Relative standard deviation of the path's size: the covariance of all centres along their own offsets from the
/// first.
double scale_deviation(const StartProblem& problem, const StartPath& path, const StartState& state,
                       const StartMatrix& covariance) {
  StartVector along = StartVector::Zero();
  double size2 = 0;
  for (int k = 1; k < problem.frames; ++k) {
    const Vec3 d = path[k].position(state);
    along += path[k].position_rows(state.g_0).transpose() * d;
    size2 += d.squaredNorm();
  }
  return std::sqrt(along.dot(covariance * along)) / std::max(size2, 1e-12);
}

}  // namespace

bool approach(const StartProblem& problem, StartState& state, StartPath& path, int most, ApproachFigures& figures) {
  Descent descent(problem, path);
  for (const Stage& stage : kApproach)
    if (!descent.descend(stage, most - descent.iterations(), state)) return false;
  figures = {descent.normal().cost, descent.freedom(), descent.iterations()};
  return true;
}

bool refine(const StartProblem& problem, StartState& state, StartPath& path, RefinementFigures& figures) {
  Descent descent(problem, path);
  if (!descent.descend(kFinal, kFinal.iterations, state)) return false;
  descent.place(state);
  const StartMatrix H = descent.normal().H.selfadjointView<Eigen::Upper>();
  const Eigen::LDLT<StartMatrix> ldlt(H);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return false;
  figures.covariance = ldlt.solve(StartMatrix::Identity());
  figures.cost = descent.normal().cost;
  figures.pull = descent.pull();
  figures.sigma_scale = scale_deviation(problem, path, state, figures.covariance);
  figures.residual = descent.typical_residual(figures.tracks);
  return figures.covariance.allFinite();
}

}  // namespace epiline
