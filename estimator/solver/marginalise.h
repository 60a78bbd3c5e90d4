#pragma once
// Marginalisation of the oldest frame by innovation. Derivation: docs/derivations/marginalisation.md.
#include <memory>

#include "estimator/factors/visual.h"
#include "estimator/solver/linear_system.h"
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
  /// Takes the pose of frame k > 0, which is about to be dropped, out of the prior; nothing if it is not in there.
  void forget_pose(Window& window, int k);

 private:
  struct Memory;
  const FactorKernels& factors_;
  const EliminationKernels& elimination_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace epiline
