#pragma once
// The one interface of the visual factors.
#include "estimator/solver/kernels.h"
#include "estimator/window/window.h"

namespace epiline {

struct VisualSettings {
  double pixel_sigma = 0.5;      ///< noise of a bearing for kernel and gate, px
  double sigma_inflation = 1.5;  ///< its covariance is wider by this factor
  double cauchy = 2;             ///< kernel scale in pixel_sigma
  bool gate = true;
  double gate_cap = 0.4;
  double focal_px = 458;
  bool extrinsics = false;  ///< fill the extrinsic columns
  int inner_steps = 4;      ///< of the point inside a track; fewer bias scale on straight flights
};

/// Turns the window's bearings into normal equations of poses and calibration. No landmark is a state in any of them.
class VisualFactorModel {
 public:
  virtual ~VisualFactorModel() = default;
  /// Collects the window's bearings for the linearisations that follow; once a frame.
  virtual void collect(const Window& window, const VisualSettings& settings) noexcept = 0;
  /// Normal equations at the window's current state.
  virtual void linearise(const Window& window, VisualSystem& out) noexcept = 0;
  /// What frame 0's bearings add given the frames 1..n-2 (the newest may still be dropped), over frames 0..n-2.
  virtual void marginalise_oldest(const Window& window, const VisualSettings& settings, VisualSystem& out) noexcept = 0;
  /// Robust noise estimate from the last linearisation: the bearing noise, px, that its residuals show; 0: too few
  /// tracks.
  virtual double residual_sigma_px() noexcept { return 0; }
};

void clear(VisualSystem& s, int frames);

}  // namespace epiline
