#pragma once
// The paper's epipolar residual. Derivation: docs/derivations/epipolar.md; test:
// tests/estimator/factors/gradient_test.cc.
#include "estimator/factors/visual.h"

namespace epiline {

/// r = (f/1.5) z_j' R_j' [t/|t|]x R_i z_i for every pair of frames that sees a track (Song and Olivares-Mendez,
/// "Structureless VIO"), Huber(1), no first-estimate Jacobians: exactly as printed. z are normalised image coordinates,
/// not unit bearings.
class EpipolarFactor final : public VisualFactorModel {
 public:
  void collect(const Window&, const VisualSettings& s) noexcept override { settings_ = s; }
  void linearise(const Window&, VisualSystem&) noexcept override;
  double cost(const Window&) noexcept override;
  void marginalise_oldest(const Window&, const VisualSettings&, VisualSystem&) noexcept override;

 private:
  VisualSettings settings_;
  VisualSystem trial_;
};

/// One view as the epipolar residual uses it, all in the world.
struct EpipolarView {
  Vec3 z_W;    ///< R_WC (x, y, 1)
  Vec3 c;      ///< camera centre
  Vec3 lever;  ///< camera centre from the body
};

struct EpipolarJacobians {
  Vec6 i, j;  ///< (dp, dphi), rotation perturbed in the world
};

/// Residual in units of 1.5 px and its Jacobians. A zero baseline gives a zero direction and zero residual.
double epipolar_residual(const EpipolarView& i, const EpipolarView& j, double focal_px, EpipolarJacobians* J);

}  // namespace epiline
