#pragma once
// The depth of tracks near the end of a range finder's beam: it gives the window its scale. Derivation:
// docs/derivations/height.md#tracks-near-a-beam; test: tests/estimator/factors/beam_test.cc.
#include <span>

#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// The ground below the beam differs from that around it for this way at a time.
inline constexpr double kGroundStretch_m = 50;

struct BeamSettings {
  double sigma_rad = 0;        ///< of a bearing
  double range_sigma_m = 0.1;  ///< of a distance
  double ground_walk = 0.05;   ///< of the ground's height between beam and track, m per root of a metre
  double ground_m = 0;         ///< how far the ground below the beam is off that of the tracks, for kGroundStretch_m
};

/// Looks for tracks near the beams of frames that have a range reading and no tracks, and weighs those of all frames at
/// the present states. Once before each solve; the solve keeps them. `used`: ids of tracks that have served frames that
/// have left.
void choose_beam_tracks(Window& window, const BeamSettings& settings, std::span<const std::uint32_t> used);

/// Height of the ground by a frame's tracks minus that of its beam's end, m, linear in the reciprocal of the tracks'
/// depth, with J = d r / d (p, theta) of each frame that it depends on.
struct BeamResidual {
  bool active = false;
  double r = 0;
  std::array<Vec6, kMaxFrames> J;
};
/// Of frame k, from the views of the first `frames`.
void evaluate_beam(const Window& window, int k, int frames, bool with_slopes, BeamResidual& out);

/// Returns the cost; null: the cost alone.
double add_beam(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
