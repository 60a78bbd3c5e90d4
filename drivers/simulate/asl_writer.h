#pragma once
// A simulated flight as a folder that a replay reads: ASL layout, tracks in place of images.
#include <filesystem>

#include "drivers/simulate/track_simulator.h"
#include "platform/error/result.h"

namespace epiline {

/// Writes `folder`/mav0: cam0/{sensor.yaml,tracks.csv}, imu0/{sensor.yaml,data.csv} and the truth at each image.
/// Existing files of these names are overwritten. Fails if and only if a folder cannot be made or a file cannot be
/// written whole.
Status write_asl(const TrackSimulation& simulation, const SimulatedFlight& flight, const std::filesystem::path& folder);

}  // namespace epiline
