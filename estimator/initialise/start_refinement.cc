#include "estimator/initialise/start_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/initialise/start_point.h"

namespace epiline {
namespace {

using Share = PointElimination::Share;

struct Stage {
  double kernel;     // Cauchy scale, in sigmas
  Share share;       // of the tracks
  int iterations;    // at most
  double converged;  // share of the cost: a step that gains, or promises, less is the last
};
// A wide kernel pulls from afar, and for that a third of the tracks will do; the last one forgets gross errors. Each of
// the wide stages only has to lead to where the next one begins.
constexpr std::array<Stage, 2> kApproach = {{{32, Share::kThird, 8, 1e-2}, {8, Share::kThird, 8, 1e-3}}};
constexpr Stage kFinal = {2, Share::kAll, 8, 1e-4};

void add_prior(const StartProblem& problem, const StartState& s, StartNormal& n) {
  StartVector information, error = StartVector::Zero();
  information << Eigen::Matrix<double, 5, 1>::Zero(), Vec3::Constant(1 / (problem.b_g_sigma * problem.b_g_sigma)),
      Vec3::Constant(1 / (problem.b_a_sigma * problem.b_a_sigma));
  error.segment<3>(5) = s.b_g - problem.b_g_ref;
  error.tail<3>() = s.b_a;
  n.H.diagonal() += information;
  n.b -= information.cwiseProduct(error);
  n.cost += error.dot(information.cwiseProduct(error));
  const Vec3 dv = s.v_0 - problem.v_0_ref, pull = problem.v_0_information * dv;
  n.H.topLeftCorner<3, 3>() += problem.v_0_information;
  n.b.head<3>() -= pull;
  n.cost += dv.dot(pull);
}

/// The least squares of one problem, whose tracks `points` has collected.
class Descent {
 public:
  Descent(const StartProblem& problem, PointElimination& points, StartPath& path)
      : problem_(problem), points_(points), path_(path) {
    points.forget_points();
  }
  /// Damped Gauss-Newton of one stage. False if the normal equations cannot be solved.
  bool descend(const Stage& stage, int most, StartState& state);
  int iterations() const { return iterations_; }
  /// Mean score at the state accepted last.
  double pull() const { return mean_score(accepted_, problem_.frames); }
  const StartNormal& normal() const { return now_; }
  /// Of the tracks, at `state`.
  double typical_residual(const StartState& state, int& tracks);

 private:
  void place(const StartState& s);
  void linearise(const StartState& s, const Stage& stage, StartNormal& n);
  /// The last linearisation is the one to go on from.
  void accept() {
    points_.accept();
    accepted_ = trial_;
  }

  const StartProblem& problem_;
  PointElimination& points_;
  StartPath& path_;
  StartCameras camera_;
  StartEquations trial_, accepted_;
  StartNormal now_;
  int iterations_ = 0;
};

void Descent::place(const StartState& s) {
  chain(problem_, s.b_g, s.b_a, path_);
  place_cameras(problem_, path_, s, camera_);
}

void Descent::linearise(const StartState& s, const Stage& stage, StartNormal& n) {
  place(s);
  const GravityTurns gravity = kGravity * gravity_basis(s.g_0);
  points_.eliminate(camera_, gravity, problem_.sigma_rad, stage.kernel, stage.share, trial_);
  n = {};
  add_prior(problem_, s, n);
  add(trial_, camera_, problem_.frames, gravity, n);
}

bool Descent::descend(const Stage& stage, int most, StartState& state) {
  StartNormal trial;
  linearise(state, stage, now_);
  accept();
  double damping = 1e-6;
  for (int n = 0; n < std::min(most, stage.iterations); ++n) {
    StartMatrix H = now_.H.selfadjointView<Eigen::Upper>();
    H.diagonal() *= 1 + damping;
    const Eigen::LLT<StartMatrix> llt(H);
    if (llt.info() != Eigen::Success) return false;
    const StartVector step = llt.solve(now_.b);
    if (!step.allFinite()) return false;
    if (step.dot(now_.b) < stage.converged * now_.cost) break;
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
    if (gain < stage.converged * now_.cost) break;
  }
  return true;
}

double Descent::typical_residual(const StartState& state, int& tracks) {
  place(state);
  return points_.typical_residual(camera_, problem_.sigma_rad, kFinal.kernel, tracks);
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

bool approach(const StartProblem& problem, PointElimination& points, StartState& state, StartPath& path, int most,
              ApproachFigures& figures) {
  Descent descent(problem, points, path);
  for (const Stage& stage : kApproach)
    if (!descent.descend(stage, most - descent.iterations(), state)) return false;
  figures = {descent.normal().cost, points.freedom(kApproach.back().share), descent.iterations()};
  return true;
}

bool refine(const StartProblem& problem, PointElimination& points, StartState& state, StartPath& path,
            RefinementFigures& figures) {
  Descent descent(problem, points, path);
  if (!descent.descend(kFinal, kFinal.iterations, state)) return false;
  figures.residual = descent.typical_residual(state, figures.tracks);
  const StartMatrix H = descent.normal().H.selfadjointView<Eigen::Upper>();
  const Eigen::LDLT<StartMatrix> ldlt(H);
  if (ldlt.info() != Eigen::Success || !ldlt.isPositive()) return false;
  figures.covariance = ldlt.solve(StartMatrix::Identity());
  figures.cost = descent.normal().cost;
  figures.pull = descent.pull();
  figures.sigma_scale = scale_deviation(problem, path, state, figures.covariance);
  return figures.covariance.allFinite();
}

}  // namespace epiline
