#pragma once
// Windows and settings for tests of the solver.
#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "estimator/solver/marginalise.h"
#include "estimator/solver/solver.h"
#include "tests/estimator/height_readings.h"
#include "tests/estimator/synthetic_window.h"
#include "tests/estimator/wheel_readings.h"

namespace epiline::test {

inline constexpr SolverSettings kEverything{.steps = 1,
                                            .estimate_time_offset = true,
                                            .estimate_extrinsics = true,
                                            .estimate_focal_length = true,
                                            .estimate_imu_scale = true};

inline CalibrationTangent calibration_sigmas() {
  CalibrationTangent s;
  s << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.01), 0.01, 0.01, 0.01, 0.01;
  return s;
}

/// No kernel, no gate; the point converges within the evaluation.
inline VisualSettings quadratic(bool extrinsics) {
  VisualSettings s;
  s.pixel_sigma = 0.5;
  s.sigma_inflation = 1;
  s.cauchy = 1e6;
  s.gate = false;
  s.extrinsics = s.lens = extrinsics;
  s.inner_steps = 12;
  s.converged = 0;
  return s;
}

/// A window of `frames` with everything in it: a prior over all frames but the two newest, rest, wheel and height
/// factors, calibration.
inline SyntheticWindow full_window(int frames) {
  const bool with_history = frames > 2;
  SyntheticWindow s = make_window({.frames = std::min(frames + (with_history ? 1 : 0), kMaxFrames)});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  const int still = std::min(1, w.size() - 1);
  w.at(still).at_rest = true;
  if (still > 0) w.at(still).rest_link = w.at(0).id;
  furnish_wheels(w);
  furnish_heights(w);
  if (with_history) {
    TrackFactor factor(best_instruction_set());
    const VisualSettings settings = quadratic(true);
    factor.collect(w, settings);
    Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, settings);
    for (int k = 0; k < w.prior.frames; ++k) w.at(k).x.p += Vec3(1e-3, -2e-3, 5e-4);  // off the prior's centre
    w.at(w.size() - 1).at_rest = true;
    w.at(w.size() - 1).rest_link = w.at(0).id;
  }
  if (w.size() < frames) {  // a window at its capacity: the newest frame without bearings
    const NavState x = w.newest().x;
    const Preintegration imu = w.newest().imu;
    Slot& slot = w.append();
    slot.x = x;
    slot.imu = imu;
    whiten(slot);
  }
  return s;
}

/// The visual factor that says nothing.
class NoVision final : public VisualFactorModel {
 public:
  void collect(const Window&, const VisualSettings&) noexcept override {}
  void linearise(const Window& w, VisualSystem& out) noexcept override { clear(out, w.size()); }
  double cost(const Window&) noexcept override { return 0; }
  void marginalise_oldest(const Window& w, const VisualSettings&, VisualSystem& out) noexcept override {
    clear(out, w.size());
  }
};

}  // namespace epiline::test
