#pragma once
// What of a recorded flight is replayed, and how it is set up: the same for one thread and for several.
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "drivers/replay/asl_dataset.h"
#include "drivers/replay/replay.h"
#include "pipeline/config/config.h"
#include "pipeline/report/flight_record.h"

namespace epiline {

struct PlannedImage {
  std::size_t index = 0;  ///< in the data set
  HostStamp stamp;        ///< shift included
};

struct FlightPlan {
  std::vector<PlannedImage> images;              ///< in time order
  std::size_t chosen = 0;                        ///< those and the ones left out
  std::map<std::string, std::uint64_t> skipped;  ///< images of the chosen ones that do not advance in time
  std::size_t first_imu = 0;                     ///< index in the data set's samples
  double duration_s = 0;                         ///< of the whole data set
};

/// Chooses the images between the two times (seconds after the first) and the IMU samples from 1 s before.
FlightPlan plan_flight(const AslDataset& dataset, const ReplayOptions& options);

/// A record with everything that is known before the flight.
FlightRecord begin_record(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                          const ReplayOptions& options);

double peak_rss_mib();

/// The flight in real time, in threads. Fails if and only if an image is wrong, or there is no thread left.
Result<FlightRecord> replay_in_real_time(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                                         const ReplayOptions& options,
                                         const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
