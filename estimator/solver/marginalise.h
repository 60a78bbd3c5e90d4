#pragma once
// Marginalisation of the oldest frame by innovation, and what the prior forgets again. Derivation:
// docs/derivations/marginalisation.md.
#include <memory>

#include "estimator/factors/visual.h"
#include "estimator/solver/linear_system.h"
#include "estimator/solver/solver.h"
#include "estimator/window/window.h"

namespace epiline {

class Marginaliser {
 public:
  explicit Marginaliser(InstructionSet set);
  ~Marginaliser();
  /// Turns everything that ties frame 0 (bearings given those that stay, IMU interval 0-1, rest and wheel factors, the
  /// old prior) into a prior on the other frames that last, (v, b) of frame 1 and the calibration, freezes their first
  /// estimates and removes frame 0. Frames that may still be dropped take no part unless `visual` wants them to. Needs
  /// at least 3 frames.
  void marginalise_oldest(Window& window, VisualFactorModel& visual, const VisualSettings& settings);
  /// Where the solved window contradicts what the prior knows of the gyroscope's bias, or of the time offset, beyond
  /// its sigma, the prior forgets as much of it: they may have stepped, or drift faster than was assumed. Whether that
  /// was so of the time offset.
  bool let_step(Window& window, const SolverSettings& settings);
  /// Takes the pose of frame k > 0, which is about to be dropped, out of the prior; nothing if it is not in there.
  void forget_pose(Window& window, int k);

 private:
  struct Memory;
  void load_prior(const Window& window, const int* order);
  const FactorKernels& factors_;
  const EliminationKernels& elimination_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace epiline
