#pragma once
// A hybrid flight: real IMU samples and real motion of a recording, rendered images. docs/developers/simulation.md.
#include <filesystem>

#include "drivers/laboratory/simulate/fit_report.h"
#include "drivers/laboratory/simulate/rendered_flight.h"

namespace epiline {

struct HybridSettings {
  std::filesystem::path dataset;          ///< ASL folder with IMU and ground truth
  std::filesystem::path camera_file;      ///< empty: the data set's own cam0/sensor.yaml
  std::filesystem::path imu_calibration;  ///< empty: the data set's own
  bool simulated_imu = false;  ///< readings from the error model along the fitted motion, not the recorded ones
  ImuEffects imu_effects;      ///< of the simulated ones
  double image_rate_hz = 20;
  std::uint64_t seed = 1;  ///< of the draw of the motion
};

struct HybridFlight {
  FlightToRender flight;
  FitReport fit;
  WorldKind usual_world;  ///< a room or a hall, by the size of the flight
};

/// Fails if and only if the folder cannot be read, has no ground truth or no camera, or the fit fails.
Result<HybridFlight> hybrid_flight(const HybridSettings& settings);

}  // namespace epiline
