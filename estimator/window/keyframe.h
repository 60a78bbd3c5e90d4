#pragma once
#include "estimator/window/window.h"

namespace epiline {

struct KeyframeSettings {
  KeyframeRule rule = KeyframeRule::kCompensatedParallax;
  double parallax_px = 10;
  double focal_px = 458;
};

/// Whether the second newest frame says enough against the frame before it to be kept
/// (docs/derivations/marginalisation.md): mean parallax, lost overlap (compensated rule only), or fewer than 20 common
/// tracks.
bool is_keyframe(const Window& window, const KeyframeSettings& settings);

/// Mean angle (in pixels at the focal length) between common bearings of frames j and k, rotation taken out. 0: nothing
/// in common.
double compensated_parallax_px(const Window& window, int j, int k, double focal_px, int* common = nullptr);

/// The same between the newest frame and the oldest one with 20 tracks in common with it; 0: there is none.
double widest_parallax_px(const Window& window, double focal_px);

}  // namespace epiline
