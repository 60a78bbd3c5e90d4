#pragma once
// A flight from motion to folder: world, images, IMU, truth.
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>

#include "drivers/flights/motion/motion.h"
#include "drivers/laboratory/render/effects.h"
#include "drivers/laboratory/render/world.h"
#include "drivers/laboratory/simulate/asl_writer.h"
#include "drivers/laboratory/simulate/height_simulator.h"

namespace epiline {

/// What flies, and what is to be written about it. The camera images from `from_s` to `to_s` of the motion's time.
struct FlightToRender {
  std::unique_ptr<MotionModel> motion;
  HostStamp begin;  ///< the IMU's time at the motion's time zero
  double from_s = 0, to_s = 0;
  FlightTables tables;
};

struct RenderChoice {
  WorldKind world = WorldKind::kHall;
  FlightEffects effects;
  std::uint64_t seed = 1;
  int jobs = 1;
  std::optional<RangeSimulation> range{};  ///< of the world that is rendered, movers left out; its file is written too
  double later_s = 0;                      ///< other cameras take their images so much after the first one
};

/// A built-in flight with a simulated IMU. The camera looks along the body's x axis, or down: of `camera` only the lens
/// is used. `height_m`: of a survey.
FlightToRender built_in_flight(FlightKind kind, const ImuEffects& imu_effects, const CameraCalibration& camera,
                               double rate_hz, std::uint64_t seed, double height_m = kUsualHeight_m);

/// A camera beside the first one, as in a rig with these calibrations of both.
CameraCalibration beside(const CameraCalibration& first, const CameraCalibration& rig_first,
                         const CameraCalibration& rig_other);
/// A camera of the same lens, parallel to the first one, `baseline_m` to its right.
CameraCalibration to_the_right(const CameraCalibration& first, double baseline_m);

/// The world that fits a built-in flight.
WorldKind usual_world(FlightKind kind);

/// Writes `folder`/mav0, whole or not at all. `progress` is called from the calling thread with images done and images
/// in all. Fails if and only if a folder cannot be made or a file cannot be written whole.
Status render_flight(const FlightToRender& flight, const RenderChoice& choice, const std::filesystem::path& folder,
                     const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
