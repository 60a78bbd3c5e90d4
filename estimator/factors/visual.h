#pragma once
// The one interface of the visual factors.
#include "estimator/factors/kernels.h"
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

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
  bool rows = false;        ///< each view has its own time: of its row, or of a second camera's image
  bool lens = false;        ///< fill the columns of the lens, of factors that have them
  int inner_steps = 4;      ///< of the point inside a track, at most; fewer bias scale on straight flights
  double converged =
      1e-3;  ///< rad, and relative depth: a smaller inner step is the last; the next would be far smaller
};

/// What the tracks say of the window's motion.
struct TrackFit {
  double median_px = 0;       ///< bearing noise that their residuals show, robustly; 0: too few tracks
  double quarter_px = 0;      ///< of the quarter that fits best: the upper end
  int tracks = 0;             ///< with two views or more
  int ahead = 0, behind = 0;  ///< tracks whose rays clearly meet in front of the camera, and behind it
  int fits = 0;               ///< tracks that fit the motion
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
  /// The information that frame 0's bearings add, given those of the other frames that last (Window::lasting), over
  /// the lasting frames; over all frames if prior_reaches_newest().
  virtual void marginalise_oldest(const Window& window, const VisualSettings& settings, VisualSystem& out) noexcept = 0;
  /// True if the solver may accept an insignificant step (docs/derivations/solver.md) without a trial. This requires a
  /// cost that depends on the window's states only and is close to its quadratic model there.
  virtual bool may_step_untried() const noexcept { return false; }
  /// Of the last linearisation.
  virtual TrackFit track_fit() noexcept { return {}; }
  /// True if the last linearisation would have gated more than the cap and therefore gated nothing.
  virtual bool gate_suspended() const noexcept { return false; }

  // Only a factor with its own unknowns (landmarks: docs/derivations/reprojection.md) implements these. The
  // structureless factors have none, and do nothing.

  /// True if its prior covers all frames that stay, including the newest, as in VINS-Mono.
  virtual bool prior_reaches_newest() const noexcept { return false; }
  /// How many numbers the factor adds to the state at the last collect().
  virtual int unknowns() const noexcept { return 0; }
  /// Remembers its unknowns, for restore().
  virtual void save() noexcept {}
  /// The solver has changed the window since the last linearise(): computes the unknowns' part of that step.
  virtual void step(const Window& /*moved*/) noexcept {}
  /// The step was rejected: restores the unknowns.
  virtual void restore() noexcept {}
  /// Forgets its unknowns, because the window's states start again.
  virtual void restart() noexcept {}
};

void clear(VisualSystem& s, int frames);

/// Adds the blocks of the first `frames` frames, rotated into the tangents of their bodies.
void add_visual(const Window& window, const VisualSystem& visual, int frames, NormalEquations& out);

}  // namespace epiline
