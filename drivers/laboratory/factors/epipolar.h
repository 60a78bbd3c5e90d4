#pragma once
// The paper's epipolar residual. Derivation: docs/derivations/epipolar.md; test:
// tests/drivers/laboratory/factors/epipolar_test.cc.
#include <memory>

#include "drivers/laboratory/factors/kernels.h"
#include "estimator/factors/visual.h"

namespace epiline {

/// r = (f/1.5) z_j' R_j' [t/|t|]x R_i z_i for every pair of frames that sees a track (Song and Olivares-Mendez,
/// "Structureless VIO"), Huber(1), no first-estimate Jacobians: exactly as printed. z are normalised image coordinates,
/// not unit bearings. Two cameras in one place say nothing.
class EpipolarFactor final : public VisualFactorModel {
 public:
  explicit EpipolarFactor(InstructionSet set);
  ~EpipolarFactor() override;
  void collect(const Window&, const VisualSettings&) noexcept override;
  void linearise(const Window&, VisualSystem&) noexcept override;
  double cost(const Window&) noexcept override;
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override;
  void restart() noexcept override;

 private:
  struct Memory;
  void put_track(const Window&, const TrackRecord&, int batch, int lane);
  /// The pairs among the first `frames`; with `oldest_only` those that contain frame 0.
  void run(const Window&, int frames, bool oldest_only, VisualSystem&);

  const FactorKernels& common_;  ///< what all visual factors need
  const LaboratoryKernels& kernels_;
  std::unique_ptr<Memory> memory_;
  VisualSettings settings_;
  int tracks_ = 0, pairs_ = 0;  ///< collected: with two views or more, and their pairs of views
};

}  // namespace epiline
