#include "estimator/solver/solver.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "estimator/factors/factors.h"
#include "estimator/solver/chain_equations.h"

namespace epiline {

namespace {
// No damping at first: relative to the information of an IMU interval (1e9 1/m^2) even 1e-9 would pin down the position
// to a few decimetres, which vision and IMU cannot know.
constexpr double kFirstDamping = 0, kAfterRejection = 1e-4;
constexpr double kRounding = 1e-6;       // of the cost: a step that loses so little is accepted
constexpr double kNoGain = 1e-3;         // of the cost
constexpr double kInsignificant = 0.05;  // squared sigmas an unknown, on the mean
constexpr double kShorter = 0.5;         // share of an undamped step where all of it raises the cost
// Of 433 steps of four flights that were tried, 269 are below; none was rejected, and the cost fell by 0.8 to 2.2 times
// what the quadratic model said.
constexpr double kSmall = 0.2, kSmallNewest = 4;  // squared sigmas, on the mean and of each number of the newest state
}  // namespace

struct Solver::Memory {
  struct Iterate {
    NavState x[kMaxFrames];
    Calibration calibration;
  };
  LinearSystem system;
  VisualSystem visual;
  FactorCost cost;
  WindowStep step;
  Iterate first, last;  ///< as optimise() found the window; before the step that is tried
  StateCovariance covariance;
  CalibrationCovariance calibration_covariance;
  CrossCovariance cross_covariance;
};

Solver::Solver(InstructionSet set)
    : factors_(factor_kernels(set)), elimination_(elimination_kernels(set)), memory_(new Memory) {
  memory_->covariance.setZero();
  memory_->calibration_covariance.setZero();
  memory_->cross_covariance.setZero();
}
Solver::~Solver() = default;

LinearSystem& Solver::system() { return memory_->system; }
const VisualSystem& Solver::visual_system() const { return memory_->visual; }
const StateCovariance& Solver::covariance() const { return memory_->covariance; }
const CalibrationCovariance& Solver::calibration_covariance() const { return memory_->calibration_covariance; }
const CrossCovariance& Solver::cross_covariance() const { return memory_->cross_covariance; }
const Calibration& Solver::linearised_at() const { return memory_->last.calibration; }

namespace {

void clear(LinearSystem& s, int frames) {
  s.frames = frames;
  const int chain = frames - 1, dim = dense_dim(frames), end = (dim / kBatchLanes + 1) * kBatchLanes;
  const auto clear_row = [end](double* row, int begin) {
    std::memset(row + begin, 0, sizeof(double) * static_cast<std::size_t>(end - begin));
  };
  for (int i = 0; i < dim; ++i) clear_row(s.S[i], i / kBatchLanes * kBatchLanes);
  for (int k = 0; k < chain; ++k)
    for (int i = 0; i < 9; ++i) clear_row(s.P[k][i], first_met(k));
  std::memset(s.D, 0, sizeof s.D[0] * static_cast<std::size_t>(chain));
  std::memset(s.C, 0, sizeof s.C[0] * static_cast<std::size_t>(chain));
  std::memset(s.rhs_s, 0, sizeof s.rhs_s);
  std::memset(s.rhs_v, 0, sizeof s.rhs_v);
}

/// Parameters that are not estimated stand still: decoupled, their step is zero.
void hold_calibration(const SolverSettings& settings, LinearSystem& s) {
  const int first = calibration_column(s.frames);
  for (int c = 0; c < kCalibration; ++c) {
    if (settings.estimates(c)) continue;
    const int i = first + c;
    for (int j = 0; j < i; ++j) s.S[j][i] = 0;
    for (int j = i + 1; j < first + kCalibration; ++j) s.S[i][j] = 0;
    for (int k = 0; k < s.frames - 1; ++k)
      for (int j = 0; j < 9; ++j) s.P[k][j][i] = 0;
    s.S[i][i] = 1;
    s.rhs_s[i] = 0;
  }
}

template <class Iterate>
void save(const Window& w, Iterate& to) {
  for (int k = 0; k < w.size(); ++k) to.x[k] = w.at(k).x;
  to.calibration = w.calibration;
}

template <class Iterate>
void restore(const Iterate& from, Window& w) {
  for (int k = 0; k < w.size(); ++k) w.at(k).x = from.x[k];
  w.calibration = from.calibration;
}

}  // namespace

double Solver::linearise(const Window& w, VisualFactorModel& visual, const SolverSettings& settings) {
  LinearSystem& s = memory_->system;
  clear(s, w.size());
  visual.linearise(w, memory_->visual);
  ChainEquations equations(s);
  memory_->cost = add_factors(w, memory_->visual, {w.size(), false}, factors_, equations);
  hold_calibration(settings, s);
  return memory_->cost.all;
}

/// Solves for the step; undamped, the covariance of the newest frame's state too, since damping would flatter it.
bool Solver::factorise_and_solve(const SolverSettings& settings, double damping) {
  Memory& m = *memory_;
  if (!elimination_.factorise(m.system, damping)) return false;
  if (damping == kFirstDamping) read_covariance(settings);
  elimination_.back(m.system, m.step);
  return true;
}

/// Applies a share of the solved step. False: it is not finite.
bool Solver::step(Window& w, VisualFactorModel& visual, const SolverSettings& settings, double share) {
  const WindowStep& step = memory_->step;
  const int n = w.size();
  double sum = 0;
  for (int k = 0; k < n; ++k) {
    const Vec6 dp = share * Eigen::Map<const Vec6>(step.s + pose_column(k));
    const Vec9 dv = share * Eigen::Map<const Vec9>(k < n - 1 ? step.v[k] : step.s + newest_velocity_column(n));
    sum += dp.squaredNorm() + dv.squaredNorm();
    NavState& x = w.at(k).x;
    retract_pose(x, dp);
    x.R = so3_normalised(x.R);
    retract_velocity_biases(x, dv);
  }
  CalibrationTangent dc;
  for (int c = 0; c < kCalibration; ++c) dc[c] = settings.estimates(c) ? share * step.s[calibration_column(n) + c] : 0;
  retract(w.calibration, dc);
  visual.step(w);
  return std::isfinite(sum + dc.sum());
}

/// The newest state and the calibration come last in the order of elimination: their joint covariance needs nothing but
/// the last rows of the factor.
void Solver::read_covariance(const SolverSettings& settings) {
  Memory& m = *memory_;
  alignas(64) double C[kNewest][kNewestStride];
  elimination_.covariance(m.system, C);
  const Eigen::Map<const Eigen::Matrix<double, kNewest, kNewest>, 0, Eigen::OuterStride<kNewestStride>> joint(C[0]);
  m.covariance = joint.topLeftCorner<16, 16>();
  m.calibration_covariance = joint.bottomRightCorner<kCalibration, kCalibration>();
  m.cross_covariance = joint.topRightCorner<16, kCalibration>();
  for (int c = 0; c < kCalibration; ++c)
    if (!settings.estimates(c)) {
      m.calibration_covariance.row(c).setZero();
      m.calibration_covariance.col(c).setZero();
    }
  if (!settings.estimate_time_offset) {
    m.covariance.row(15).setZero();
    m.covariance.col(15).setZero();
  }
}

/// Whether the solved step is at most so many squared standard deviations, on the mean over the window's unknowns, and
/// for each number of the newest state, which is published.
bool Solver::is_within(const Window& w, double mean, double newest) const {
  const Memory& m = *memory_;
  if (!(m.step.squared_length < mean * 15 * w.size())) return false;
  const double* step = m.step.s + newest_column(w.size());
  for (int i = 0; i < 15; ++i)
    if (!(step[i] * step[i] < newest * m.covariance(i, i))) return false;
  return true;
}

/// Far below what is known of the window: there is nothing left to gain.
bool Solver::insignificant(const Window& w) const { return is_within(w, kInsignificant, 1); }

/// The cost after a share of the step that solves the system, infinite if there is none. The window is left there.
double Solver::try_step(Window& w, VisualFactorModel& visual, const SolverSettings& settings, double cost,
                        double share) {
  if (!step(w, visual, settings, share)) return std::numeric_limits<double>::infinity();
  return settings.tried ? visual.cost(w) + cost_without_vision(w, factors_) : cost;
}

/// To where the last step began.
void Solver::put_back(Window& w, VisualFactorModel& visual) const {
  restore(memory_->last, w);
  visual.restore();
}

void Solver::iterate(Window& w, VisualFactorModel& visual, const SolverSettings& settings, Supervisor& supervisor,
                     SolverSummary& r) {
  double damping = kFirstDamping;
  r.outcome = SolverOutcome::kImproved;
  while (r.accepted < settings.steps) {
    if (r.accepted > 0 && supervisor.time_is_up()) {
      r.outcome = SolverOutcome::kOutOfTime;
      return;
    }
    const double cost = r.cost = linearise(w, visual, settings);
    if (r.linearisations++ == 0) r.cost_first = cost;
    if (!std::isfinite(cost)) {
      r.outcome = SolverOutcome::kNotFinite;
      return;
    }
    save(w, memory_->last);
    visual.save();
    const bool has_step = factorise_and_solve(settings, damping);
    // A step within what is known of the window follows the quadratic model: it needs no trial.
    const bool untried = has_step && visual.may_step_untried() && damping == kFirstDamping &&
                         is_within(w, kSmall, kSmallNewest) && step(w, visual, settings, 1);
    double trial = untried    ? cost - memory_->step.squared_length
                   : has_step ? try_step(w, visual, settings, cost, 1)
                              : std::numeric_limits<double>::infinity();
    const double scale = std::abs(cost) + 1, most = cost + kRounding * scale;
    // Damping takes from a step what little is known first, as the scale: the window would stay where it is.
    if (has_step && damping == kFirstDamping && !(trial <= most)) {
      put_back(w, visual);
      trial = try_step(w, visual, settings, cost, kShorter);
    }
    if (trial <= most) {
      ++r.accepted;
      r.cost = trial;
      damping = std::max(damping * 0.1, kFirstDamping);
      const bool goes_on = r.accepted < 2 || cost - trial >= kNoGain * scale;
      if (goes_on && !(untried && insignificant(w))) continue;
      r.outcome = SolverOutcome::kConverged;
      return;
    }
    put_back(w, visual);
    // Without parallax the depths jump and the cost with them; there the quadratic model tells when a step is far below
    // what is known of the state.
    const bool nothing_to_gain = trial < cost + kNoGain * scale || (std::isfinite(trial) && insignificant(w));
    if (nothing_to_gain) {
      r.outcome = SolverOutcome::kConverged;
      return;
    }
    const int attempts = std::min(settings.attempts, kMostAttempts);
    if (++r.rejected >= attempts || supervisor.time_is_up()) {
      r.outcome = r.rejected >= kMostAttempts ? SolverOutcome::kGaveUp : SolverOutcome::kOutOfTime;
      return;
    }
    damping = std::max(damping * 30, kAfterRejection);
  }
}

void Solver::take_back(Window& w) const { restore(memory_->first, w); }

SolverSummary Solver::optimise(Window& w, VisualFactorModel& visual, const SolverSettings& settings,
                               Supervisor& supervisor) {
  SolverSummary r;
  save(w, memory_->first);
  memory_->covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  iterate(w, visual, settings, supervisor, r);
  r.imu_cost = memory_->cost.imu;
  r.residuals = memory_->visual.residuals;
  r.tracks = memory_->visual.tracks;
  r.gated = memory_->visual.gated;
  // Every factorisation but the first was damped after a rejection: its covariance is still to be had.
  if (r.solved() && r.rejected > 0) {
    linearise(w, visual, settings);
    save(w, memory_->last);
    ++r.linearisations;
    if (!factorise_and_solve(settings, kFirstDamping)) r.outcome = SolverOutcome::kGaveUp;
  }
  if (r.solved() && !memory_->covariance.allFinite()) r.outcome = SolverOutcome::kNotFinite;
  if (!r.solved()) {  // nothing of a step that was not taken may pass for knowledge
    restore(memory_->first, w);
    memory_->covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
    memory_->calibration_covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return r;
}

}  // namespace epiline
