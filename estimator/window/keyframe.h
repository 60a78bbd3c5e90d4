#pragma once
#include "estimator/window/window.h"

namespace epiline {

struct KeyframeSettings {
  double parallax_px = 10;
  double focal_px = 458;
};

/// True if frame k is the first one (j < 0), or differs enough from the earlier frame j to be kept as a keyframe
/// (docs/derivations/marginalisation.md): mean parallax, lost overlap, or fewer than 20 common tracks.
bool is_keyframe(const Window& window, int j, int k, const KeyframeSettings& settings);

/// Mean parallax of the tracks that frames j and k share, rotation removed, in pixels at the focal length. 0: no common
/// tracks.
double compensated_parallax_px(const Window& window, int j, int k, double focal_px);
/// How many those are.
int common_tracks(const Window& window, int j, int k);

/// The same between the newest frame and the oldest one that shares 20 tracks with it; 0: no such frame.
double widest_parallax_px(const Window& window, double focal_px);

}  // namespace epiline
