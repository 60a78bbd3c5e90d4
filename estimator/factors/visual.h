#pragma once
// The one interface of the visual factors.
#include "estimator/factors/kernels.h"
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// Where nothing is seen of it, the inverse depth of a point is held, 1/(1/m)^2: a standard deviation of 5 1/m on its
/// change.
inline constexpr double kDepthDamping = 0.04;

struct VisualSettings {
  double pixel_sigma = 0.5;      ///< noise of a bearing for kernel and gate, px
  double sigma_inflation = 1.5;  ///< its covariance is wider by this factor
  double cauchy = 2;             ///< kernel scale in pixel_sigma
  TrackNoiseModel noise = TrackNoiseModel::kWhite;
  double drift_sigma = 0.15;   ///< step of a drifting track's error, px per root of an image
  double drift_inflation = 2;  ///< its covariance is wider by this factor
  double student = 2;          ///< of its weight, degrees of freedom
  bool gate = true;
  double gate_cap = 0.4;
  double focal_px = 458;
  bool extrinsics = false;  ///< fill the extrinsic columns
  bool rows = false;        ///< rolling shutter: views have times of their own
  bool focal = false;       ///< fill the column of the focal length, of factors that have one
  int inner_steps = 4;      ///< of the point inside a track, at most; fewer bias scale on straight flights
  double converged =
      1e-3;  ///< rad, and relative depth: a smaller inner step is the last; the next would be far smaller
};

/// Turns the window's bearings into normal equations of poses and calibration.
class VisualFactorModel {
 public:
  virtual ~VisualFactorModel() = default;
  /// Collects the window's bearings for the linearisations that follow; once a frame.
  virtual void collect(const Window& window, const VisualSettings& settings) noexcept = 0;
  /// Normal equations at the window's current state.
  virtual void linearise(const Window& window, VisualSystem& out) noexcept = 0;
  /// The cost alone, with the gate as the last linearisation left it.
  virtual double cost(const Window& window) noexcept = 0;
  /// What frame 0's bearings add given the frames 1..n-2 (the newest may still be dropped), over frames 0..n-2; over
  /// all of them if prior_reaches_newest().
  virtual void marginalise_oldest(const Window& window, const VisualSettings& settings, VisualSystem& out) noexcept = 0;
  /// Whether the solver may take a step far below what is known of the window without a trial. That asks for a cost
  /// that depends on the window's states alone and is close to its quadratic model there.
  virtual bool may_step_untried() const noexcept { return false; }
  /// Robust noise estimate from the last linearisation: the bearing noise, px, that its residuals show; 0: too few
  /// tracks.
  virtual double residual_sigma_px() noexcept { return 0; }
  /// True if the last linearisation would have gated more than the cap and therefore gated nothing.
  virtual bool gate_suspended() const noexcept { return false; }

  // Only a factor with unknowns of its own (landmarks: docs/derivations/reprojection.md) has these. The structureless
  // ones have none, and nothing to do.

  /// Whether the prior it leaves is one over all frames that stay, the newest included, as in VINS-Mono.
  virtual bool prior_reaches_newest() const noexcept { return false; }
  /// How many numbers the factor adds to the state at the last collect().
  virtual int unknowns() const noexcept { return 0; }
  /// Remembers its unknowns, for restore().
  virtual void save() noexcept {}
  /// The solver has moved the window from where linearise() last saw it: the unknowns' part of that step.
  virtual void step(const Window& /*moved*/) noexcept {}
  /// The step is taken back.
  virtual void restore() noexcept {}
  /// Forgets its unknowns: the window's states begin anew.
  virtual void restart() noexcept {}
};

void clear(VisualSystem& s, int frames);

/// Adds the blocks of the first `frames` frames, turned into the tangents of their bodies.
void add_visual(const Window& window, const VisualSystem& visual, int frames, NormalEquations& out);

}  // namespace epiline
