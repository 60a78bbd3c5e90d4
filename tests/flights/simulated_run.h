#pragma once
// One simulated flight through the estimator, from a known start, and how well it did.
#include <cstdint>
#include <functional>

#include "drivers/laboratory/simulate/track_simulator.h"
#include "estimator/estimator.h"

namespace epiline {

/// Figures of one run; definitions at run_simulated().
struct RunFigures {
  bool diverged = false;
  double diverged_at_s = 0;
  double ate_m = 0;
  double nees_position = 0, nees_rotation = 0;  ///< per degree of freedom, mean over the run
};

/// Every frame solved, noise and calibration known.
EstimatorConfig known_config(const TrackSimulation& simulation);

/// Starts the estimator in the first image from ground truth plus a random error (`seed`) with the standard deviations
/// of InitialState, and passes it every second image.
///
/// ATE: rms of the newest-frame positions after alignment in translation and yaw. NEES: of absolute position and
/// rotation, once per second after 5 s. Diverged: off by more than 2 m and a tenth of the path so far, or a frame
/// without a pose, or a reset; the run ends there.
RunFigures run_simulated(const SimulatedFlight& flight, const EstimatorConfig& config, std::uint64_t seed);

/// Means over runs with the seeds 1, 2, ...; diverged: one of them has. `alter`: what the estimator is not told.
RunFigures mean_of_runs(
    TrackSimulation simulation, int runs, const std::function<void(EstimatorConfig&)>& alter = [](EstimatorConfig&) {});

}  // namespace epiline
