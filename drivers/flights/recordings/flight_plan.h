#pragma once
// What of a recorded flight is flown.
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"

namespace epiline {

/// The part that somebody wants.
struct FlightPart {
  double start_s = 0;  ///< of images left out at the beginning
  double duration_s = std::numeric_limits<double>::infinity();
  double shift_images_ms = 0;  ///< added to the images' stamps: a made-up time offset
};

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
FlightPlan plan_flight(const AslDataset& dataset, const FlightPart& part);

}  // namespace epiline
