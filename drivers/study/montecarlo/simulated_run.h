#pragma once
// One simulated flight through the estimator, from a known start, and how well it did.
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/flights/simulate/track_simulator.h"
#include "estimator/estimator.h"

namespace epiline {

/// Figures of one run; definitions at run_simulated().
struct RunFigures {
  bool diverged = false;
  double diverged_at_s = 0;
  double ate_m = 0;
  double rpe_5s_m = 0;
  double scale_error = 0;
  double yaw_end_deg = 0;
  double nees_position = 0, nees_rotation = 0;                ///< per degree of freedom, mean over the run
  double time_offset_error_s = 0;                             ///< estimated minus true, at the end
  std::vector<double> solve_ms, marginalise_ms, estimate_ms;  ///< one each for every frame
};

/// The configuration that compares factors: every frame solved, noise and calibration known. The epipolar factor is the
/// paper's, the reprojection factor VINS-Mono's: with its keyframe rule, no zero-motion factor, no gate.
EstimatorConfig comparison_config(VisualFactor factor, const TrackSimulation& simulation);

/// Starts the estimator in the first image from ground truth plus a random error (`seed`) with the standard deviations
/// of InitialState, and passes it every second image.
///
/// ATE: rms of the newest-frame positions after alignment in translation and yaw. RPE: rms error of the motion over 5
/// s, in the body frame at its beginning. Scale error: regression of the aligned positions on the true ones, minus 1.
/// Yaw: absolute error at the end. NEES: of absolute position and rotation, once per second after 5 s. Diverged:
/// has_diverged() by the path so far, or a frame without a pose, or a reset; the run ends there.
RunFigures run_simulated(const SimulatedFlight& flight, const EstimatorConfig& config, std::uint64_t seed);

}  // namespace epiline
