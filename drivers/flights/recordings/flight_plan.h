#pragma once
// The part of a recorded flight to replay.
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"

namespace epiline {

/// The requested part.
struct FlightPart {
  double start_s = 0;  ///< of images left out at the beginning
  double duration_s = std::numeric_limits<double>::infinity();
  double shift_images_ms = 0;  ///< added to the images' timestamps: a simulated time offset
};

struct PlannedImage {
  std::size_t index = 0;                                         ///< in the data set
  HostStamp stamp;                                               ///< shift included
  std::array<std::optional<std::size_t>, kMostOthers> others{};  ///< the images of the others at that time, if any
  OtherSpans later{};                                            ///< their times less that of the first camera's image
};

struct FlightPlan {
  std::vector<PlannedImage> images;              ///< in time order
  std::size_t chosen = 0;                        ///< number of images in the part, including those left out
  std::map<std::string, std::uint64_t> skipped;  ///< images left out because their timestamps do not increase
  std::size_t first_imu = 0;                     ///< index in the data set's samples
  double duration_s = 0;                         ///< of the whole data set
  OtherSpans apart{};  ///< from the first camera's images, the most; zero: both are triggered together
};

/// Chooses the images between the two times (seconds after the first) and the IMU samples from 1 s before.
FlightPlan plan_flight(const AslDataset& dataset, const FlightPart& part);

}  // namespace epiline
