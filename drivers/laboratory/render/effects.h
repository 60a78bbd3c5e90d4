#pragma once
// What lens, sensor, camera and IMU do to a flight, as the command line names it.
#include <string>
#include <string_view>

#include "drivers/laboratory/render/renderer.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "platform/error/result.h"

namespace epiline {

struct FlightEffects {
  CameraEffects camera;
  double dropped_share = 0;  ///< images that are lost, share
  int movers = 0;            ///< things that move about
  ImuEffects imu;            ///< of a simulated IMU
};

/// A list like "blur=6,noise,rolling-shutter=30": only what is named is on, with its usual strength or the one given.
/// "none": a perfect camera. A
/// simulated IMU has its usual noise and biases unless told otherwise. Fails if and only if a name is unknown or a
/// strength is no number in its range.
Result<FlightEffects> parse_effects(std::string_view list);

/// Names, units and usual strengths, for the help text.
std::string effects_help();

/// The list that stands for what is on when nothing is said.
inline constexpr const char* kUsualEffects = "blur,lens-blur,vignette,noise,auto-exposure,moving";

}  // namespace epiline
