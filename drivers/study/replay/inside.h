#pragma once
// Functions that replays in one thread and in several share.
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "drivers/study/replay/replay.h"
#include "pipeline/config/config.h"

namespace epiline {

/// A record with all facts that are known before the flight.
FlightRecord begin_record(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                          const ReplayOptions& options);

/// The recorded points of each image of the plan; empty for a data set with images.
std::vector<std::span<const TrackPoint>> recorded_points(const AslDataset& dataset, const FlightPlan& plan);

/// Of cameras 1 to 3, those that are there.
std::array<std::optional<CameraParameters>, kMostOthers> other_lenses(const AslDataset& dataset);

/// The flight in real time, in threads. Fails if and only if an image is wrong, or the system has no thread left.
Result<FlightRecord> replay_in_real_time(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                                         const ReplayOptions& options,
                                         const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
