#pragma once
// A rendered flight with small images, which takes seconds to make.
#include <filesystem>
#include <string>
#include <thread>

#include "drivers/flights/simulate/rendered_flight.h"

namespace epiline::test {

/// A quarter of the pixels of EuRoC's cameras, with the same field of view.
inline CameraCalibration small_camera() {
  CameraCalibration camera;
  camera.parameters = {.model = CameraModel::kPinholeRadialTangential,
                       .width = 376,
                       .height = 240,
                       .intrinsics = {229, 229, 187.5, 119.5},
                       .distortion = {-0.28, 0.07, 0.0002, 0, 0}};
  return camera;
}

/// Renders the first seconds of `agile`, with the usual effects and others. `baseline_m`: of a second camera; 0: there
/// is none. It takes its images `second_later_s` after the first one.
inline Status render_small_flight(const std::filesystem::path& folder, double duration_s, double baseline_m = 0,
                                  double second_later_s = 0, const std::string& more_effects = "") {
  const auto effects = parse_effects(kUsualEffects + more_effects);
  if (!effects) return effects.error();
  FlightToRender flight = built_in_flight(FlightKind::kAgile, effects->imu, small_camera(), 20, 1);
  flight.to_s = flight.from_s + duration_s;
  if (baseline_m != 0) flight.tables.second_camera = to_the_right(flight.tables.camera, baseline_m);
  const int jobs = static_cast<int>(std::thread::hardware_concurrency());
  return render_flight(flight,
                       {.world = usual_world(FlightKind::kAgile),
                        .effects = *effects,
                        .seed = 1,
                        .jobs = jobs,
                        .second_later_s = second_later_s},
                       folder, [](std::size_t, std::size_t) {});
}

}  // namespace epiline::test
