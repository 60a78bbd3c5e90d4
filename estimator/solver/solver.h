#pragma once
// Damped Gauss-Newton over the window. Derivation: docs/derivations/solver.md.
#include <memory>

#include "estimator/factors/visual.h"
#include "estimator/window/window.h"

namespace epiline {

struct SolverSettings {
  int steps = 2;  ///< accepted steps at most
  bool estimate_time_offset = true;
  bool estimate_extrinsics = false;
  int attempts = 4;   ///< steps that may be rejected; after the last the solver gives up
  bool tried = true;  ///< false: a step is accepted as it is, which saves the linearisation that would try it
};

struct SolverSummary {
  bool ok = false;  ///< the cost is finite and not every step had to be rejected
  int accepted = 0, rejected = 0, linearisations = 0;
  double cost_first = 0, cost = 0;
  int residuals = 0, tracks = 0, gated = 0;
  bool out_of_time = false;
  bool unimproved = false;  ///< cut short before any step was accepted: the window is where it was
};

/// Covariance of the newest frame's state and the time offset: 16x16, order dp, dtheta, dv, dba, dbg, dtd.
using NewestCovariance = Eigen::Matrix<double, 16, 16>;

class Solver {
 public:
  explicit Solver(const Kernels& kernels);
  ~Solver();
  /// Improves the window's states and calibration in place; keeps the best accepted iterate when time is up.
  SolverSummary optimise(Window& window, VisualFactorModel& visual, const SolverSettings& settings,
                         Supervisor& supervisor);
  /// From the last accepted step's factorisation.
  const NewestCovariance& covariance() const;
  /// Covariance of the seven calibration parameters (zero rows where not estimated).
  const Eigen::Matrix<double, kCalibration, kCalibration>& calibration_covariance() const;

  // The pieces, for tests and marginalisation.
  /// Normal equations at the current state into system(); returns the cost.
  double linearise(const Window& window, VisualFactorModel& visual, const SolverSettings& settings);
  LinearSystem& system();
  const VisualSystem& visual_system() const;

 private:
  struct Memory;
  bool factorise_and_solve(const Window& window, double damping);
  bool apply_step(Window& window, VisualFactorModel& visual, const SolverSettings& settings);
  void save(const Window& window, VisualFactorModel& visual);
  void restore(Window& window, VisualFactorModel& visual);
  void read_covariance(const Window& window, const SolverSettings& settings);

  const Kernels& kernels_;
  std::unique_ptr<Memory> memory_;
};

/// Column of S where frame k's pose begins: newest first.
inline int pose_column(int frames, int k) { return 6 * (frames - 1 - k); }

/// IMU factor between frames k-1 and k: whitened normal equations A (30x32, tangent order of k-1 then k) and g; returns
/// the cost.
double imu_normal_equations(const Window& w, int k, const Kernels& kernels, double (*A)[32], double* g);

/// Square-root information of the slot's IMU interval; to be called whenever `imu` changed. False: covariance not
/// positive.
bool whiten(Slot& slot);

inline constexpr double kRestVelocitySigma = 0.01;   ///< m/s, zero-motion factor
inline constexpr double kRestPositionSigma = 0.003;  ///< m

}  // namespace epiline
