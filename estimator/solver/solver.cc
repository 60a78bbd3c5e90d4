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
  StepColumns columns;
  double expected_gain;  ///< of the solved step, were the cost quadratic: its squared length in sigmas
  Iterate first, last;   ///< as optimise() found the window; before the step that is tried
  StateCovariance covariance;
  CalibrationCovariance calibration_covariance;
};

Solver::Solver(InstructionSet set)
    : factors_(factor_kernels(set)), elimination_(elimination_kernels(set)), memory_(new Memory) {
  memory_->covariance.setZero();
  memory_->calibration_covariance.setZero();
}
Solver::~Solver() = default;

LinearSystem& Solver::system() { return memory_->system; }
const VisualSystem& Solver::visual_system() const { return memory_->visual; }
const StateCovariance& Solver::covariance() const { return memory_->covariance; }
const CalibrationCovariance& Solver::calibration_covariance() const { return memory_->calibration_covariance; }
const Calibration& Solver::linearised_at() const { return memory_->last.calibration; }

namespace {

bool estimated(const SolverSettings& s, int calibration) {
  if (calibration == kTimeOffsetColumn) return s.estimate_time_offset;
  if (calibration >= kCameraCalibration) return s.estimate_imu_scale;
  return calibration == kFocalColumn ? s.estimate_focal_length : s.estimate_extrinsics;
}

void clear(LinearSystem& s, int frames) {
  s.frames = frames;
  const int dim = s.pose_dim();
  const std::size_t row =
      sizeof(double) * static_cast<std::size_t>((dim + kBatchLanes - 1) / kBatchLanes * kBatchLanes);
  for (int i = 0; i < dim; ++i) std::memset(s.S[i], 0, row);
  for (int k = 0; k < frames; ++k)
    for (int i = 0; i < 9; ++i) std::memset(s.P[k][i], 0, row);
  std::memset(s.D, 0, sizeof s.D[0] * static_cast<std::size_t>(frames));
  std::memset(s.C, 0, sizeof s.C[0] * static_cast<std::size_t>(frames));
  std::memset(s.rhs_s, 0, sizeof s.rhs_s);
  std::memset(s.rhs_v, 0, sizeof s.rhs_v);
}

/// Parameters that are not estimated stand still: decoupled, their step is zero.
void hold_calibration(const SolverSettings& settings, LinearSystem& s) {
  const int first = 6 * s.frames;
  for (int c = 0; c < kCalibration; ++c) {
    if (estimated(settings, c)) continue;
    const int i = first + c;
    for (int j = 0; j < i; ++j) s.S[j][i] = 0;
    for (int j = i + 1; j < first + kCalibration; ++j) s.S[i][j] = 0;
    for (int k = 0; k < s.frames; ++k)
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
  const double cost = add_factors(w, memory_->visual, {w.size(), false}, factors_, equations);
  hold_calibration(settings, s);
  return cost;
}

/// Solves for the step; undamped, the covariance of the newest frame's state too, since damping would flatter it.
bool Solver::factorise_and_solve(const Window& w, const SolverSettings& settings, double damping) {
  Memory& m = *memory_;
  LinearSystem& s = m.system;
  if (!elimination_.factorise(s, damping)) return false;
  elimination_.forward(s, m.columns);
  if (damping == kFirstDamping) read_covariance(w, settings);
  elimination_.back(s, m.columns);
  // b'H^-1 b = |U^-T b|^2
  m.expected_gain = m.columns.squared_length;
  return true;
}

/// Applies the solved step. False: it is not finite.
bool Solver::step(Window& w, VisualFactorModel& visual, const SolverSettings& settings) {
  const StepColumns& columns = memory_->columns;
  const int n = w.size();
  double sum = 0;
  for (int k = 0; k < n; ++k) {
    const Vec6 dp = Eigen::Map<const Vec6>(columns.step_s + pose_column(n, k));
    const Vec9 dv = Eigen::Map<const Vec9>(columns.step_v[k]);
    sum += dp.squaredNorm() + dv.squaredNorm();
    NavState& x = w.at(k).x;
    retract_pose(x, dp);
    x.R = so3_normalised(x.R);
    retract_velocity_biases(x, dv);
  }
  CalibrationTangent dc;
  for (int c = 0; c < kCalibration; ++c) dc[c] = estimated(settings, c) ? columns.step_s[6 * n + c] : 0;
  retract(w.calibration, dc);
  visual.step(w);
  return std::isfinite(sum + dc.sum());
}

/// H = U'U in the order of elimination, so the covariance of the unknowns E is (U^-T E)'(U^-T E): the forward pass is
/// all it takes.
void Solver::read_covariance(const Window& w, const SolverSettings& settings) {
  Memory& m = *memory_;
  const int n = w.size();
  CalibrationCovariance U = CalibrationCovariance::Zero();
  for (int i = 0; i < kCalibration; ++i)
    for (int j = i; j < kCalibration; ++j) U(i, j) = m.system.S[6 * n + i][6 * n + j];
  CalibrationCovariance V = CalibrationCovariance::Identity();
  U.triangularView<Eigen::Upper>().solveInPlace(V);
  m.calibration_covariance.noalias() = V.lazyProduct(V.transpose());
  for (int c = 0; c < kCalibration; ++c)
    if (!estimated(settings, c)) {
      m.calibration_covariance.row(c).setZero();
      m.calibration_covariance.col(c).setZero();
    }
  m.covariance.setZero();
  elimination_.products(m.system, m.columns, m.covariance.data());
  for (int j = 0; j < 15 && settings.estimate_time_offset; ++j) {
    double c = 0;
    for (int i = 0; i < kCalibration; ++i) c += V(0, i) * m.columns.s[6 * n + i][1 + j];
    m.covariance(15, j) = m.covariance(j, 15) = c;
  }
  m.covariance(15, 15) = m.calibration_covariance(0, 0);
}

/// Whether the solved step is at most so many squared standard deviations, on the mean over the window's unknowns, and
/// for each number of the newest state, which is published.
bool Solver::is_within(const Window& w, double mean, double newest) const {
  const Memory& m = *memory_;
  if (!(m.expected_gain < mean * 15 * w.size())) return false;
  for (int i = 0; i < 15; ++i) {
    const double step = i < 6 ? m.columns.step_s[i] : m.columns.step_v[w.size() - 1][i - 6];
    if (!(step * step < newest * m.covariance(i, i))) return false;
  }
  return true;
}

/// Far below what is known of the window: there is nothing left to gain.
bool Solver::insignificant(const Window& w) const { return is_within(w, kInsignificant, 1); }

/// The cost after the step that solves the system, infinite if there is none. The window is left there.
double Solver::try_step(Window& w, VisualFactorModel& visual, const SolverSettings& settings, double cost) {
  if (!step(w, visual, settings)) return std::numeric_limits<double>::infinity();
  return settings.tried ? visual.cost(w) + cost_without_vision(w, factors_) : cost;
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
    const bool has_step = factorise_and_solve(w, settings, damping);
    // A step within what is known of the window follows the quadratic model: it needs no trial.
    const bool untried = has_step && visual.may_step_untried() && damping == kFirstDamping &&
                         is_within(w, kSmall, kSmallNewest) && step(w, visual, settings);
    const double trial = untried    ? cost - memory_->expected_gain
                         : has_step ? try_step(w, visual, settings, cost)
                                    : std::numeric_limits<double>::infinity();
    const double scale = std::abs(cost) + 1;
    if (trial <= cost + kRounding * scale) {
      ++r.accepted;
      r.cost = trial;
      damping = std::max(damping * 0.1, kFirstDamping);
      const bool goes_on = r.accepted < 2 || cost - trial >= kNoGain * scale;
      if (goes_on && !(untried && insignificant(w))) continue;
      r.outcome = SolverOutcome::kConverged;
      return;
    }
    restore(memory_->last, w);
    visual.restore();
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

SolverSummary Solver::optimise(Window& w, VisualFactorModel& visual, const SolverSettings& settings,
                               Supervisor& supervisor) {
  SolverSummary r;
  save(w, memory_->first);
  memory_->covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  iterate(w, visual, settings, supervisor, r);
  r.residuals = memory_->visual.residuals;
  r.tracks = memory_->visual.tracks;
  r.gated = memory_->visual.gated;
  // Every factorisation but the first was damped after a rejection: its covariance is still to be had.
  if (r.solved() && r.rejected > 0) {
    linearise(w, visual, settings);
    save(w, memory_->last);
    ++r.linearisations;
    if (!factorise_and_solve(w, settings, kFirstDamping)) r.outcome = SolverOutcome::kGaveUp;
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
