#pragma once
// Damped Gauss-Newton over the window. Derivation: docs/derivations/solver.md; test:
// tests/estimator/solver/solver_test.cc.
#include <memory>

#include "estimator/factors/visual.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/solver/linear_system.h"
#include "estimator/supervisor.h"
#include "estimator/window/window.h"

namespace epiline {

struct SolverSettings {
  int steps = 2;  ///< accepted steps at most
  bool estimate_time_offset = true;
  bool estimate_extrinsics = false;
  bool estimate_focal_length = false;
  bool estimate_imu_scale = false;
  int attempts = 4;   ///< steps that may be rejected, at most kMostAttempts
  bool tried = true;  ///< false: a step is accepted as it is, which saves its trial
  /// Of the calibration's tangent.
  bool estimates(int column) const {
    if (column == kTimeOffsetColumn) return estimate_time_offset;
    if (column >= kCameraCalibration) return estimate_imu_scale;
    return column >= kFocalColumn ? estimate_focal_length : estimate_extrinsics;
  }
};

enum class SolverOutcome : std::uint8_t {
  kConverged,  ///< another step would gain nothing worth having
  kImproved,   ///< all the steps allowed were accepted
  kOutOfTime,  ///< stopped early for lack of time: the best accepted iterate, perhaps none
  kGaveUp,     ///< every step was rejected, or the normal equations have no solution
  kNotFinite,  ///< the cost is no number
};

struct SolverSummary {
  SolverOutcome outcome = SolverOutcome::kNotFinite;
  int accepted = 0, rejected = 0, linearisations = 0;
  double cost_first = 0, cost = 0;
  // At the last linearisation. `gated` counts them also where none was dropped.
  double imu_cost = 0;
  int residuals = 0, tracks = 0, gated = 0;
  /// The window and Solver::covariance() are the solver's. Otherwise the window is where it was and nothing is known
  /// beyond what was known before.
  bool solved() const {
    return outcome == SolverOutcome::kConverged || outcome == SolverOutcome::kImproved ||
           (outcome == SolverOutcome::kOutOfTime && accepted > 0);
  }
  bool failed() const { return outcome == SolverOutcome::kGaveUp || outcome == SolverOutcome::kNotFinite; }
};

class Solver {
 public:
  static constexpr int kMostAttempts = 4;

  explicit Solver(InstructionSet set);
  ~Solver();
  /// Improves the window's states and calibration in place, or leaves them exactly as they were.
  SolverSummary optimise(Window& window, VisualFactorModel& visual, const SolverSettings& settings,
                         Supervisor& supervisor);
  /// To where the last optimise() found the window.
  void take_back(Window& window) const;
  /// Of the newest frame's state and the time offset, by the last optimise(); no numbers if that solved nothing.
  const StateCovariance& covariance() const;
  /// The same of the calibration (zero rows where not estimated).
  const CalibrationCovariance& calibration_covariance() const;
  /// Of the state and time offset with the calibration.
  const CrossCovariance& cross_covariance() const;
  /// The calibration at which the system of these covariances was linearised.
  const Calibration& linearised_at() const;

  // The pieces, for tests.
  /// Normal equations at the current state into system(); returns the cost.
  double linearise(const Window& window, VisualFactorModel& visual, const SolverSettings& settings);
  LinearSystem& system();
  const VisualSystem& visual_system() const;

 private:
  struct Memory;
  bool factorise_and_solve(const SolverSettings& settings, double damping);
  double try_step(Window& window, VisualFactorModel& visual, const SolverSettings& settings, double cost, double share);
  void put_back(Window& window, VisualFactorModel& visual) const;
  void iterate(Window& window, VisualFactorModel& visual, const SolverSettings& settings, Supervisor& supervisor,
               SolverSummary& r);
  bool step(Window& window, VisualFactorModel& visual, const SolverSettings& settings, double share);
  bool is_within(const Window& window, double mean, double newest) const;
  bool insignificant(const Window& window) const;
  void read_covariance(const SolverSettings& settings);

  const FactorKernels& factors_;
  const EliminationKernels& elimination_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace epiline
