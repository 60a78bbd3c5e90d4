#pragma once
// A rendered flight with small images, which takes seconds to make.
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "drivers/laboratory/simulate/rendered_flight.h"

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

/// Cameras beside the first one, by its calibration.
using OtherCameras = std::vector<std::function<CameraCalibration(const CameraCalibration&)>>;
inline OtherCameras second_camera(double baseline_m) {
  return {[=](const CameraCalibration& first) { return to_the_right(first, baseline_m); }};
}
/// A pair that looks back beside one that looks ahead, each `baseline_m` wide.
inline OtherCameras pairs_ahead_and_back(double baseline_m) {
  const auto back = [=](const CameraCalibration& first) {
    CameraCalibration camera = first;
    camera.R_BC.col(0) *= -1;  // about the image's vertical axis
    camera.R_BC.col(2) *= -1;
    camera.p_BC = first.p_BC - 0.1 * first.R_BC.col(2);
    return camera;
  };
  return {second_camera(baseline_m)[0], back,
          [=](const CameraCalibration& first) { return to_the_right(back(first), baseline_m); }};
}

/// Renders the first seconds of `agile`, with the usual effects and others. The other cameras take their images
/// `later_s` after the first one.
inline Status render_small_flight(const std::filesystem::path& folder, double duration_s,
                                  const OtherCameras& others = {}, double later_s = 0,
                                  const std::string& more_effects = "") {
  const auto effects = parse_effects(kUsualEffects + more_effects);
  if (!effects) return effects.error();
  FlightToRender flight = built_in_flight(FlightKind::kAgile, effects->imu, small_camera(), 20, 1);
  flight.to_s = flight.from_s + duration_s;
  for (const auto& other : others) flight.tables.other_cameras.push_back(other(flight.tables.camera));
  const int jobs = static_cast<int>(std::thread::hardware_concurrency());
  return render_flight(
      flight,
      {.world = usual_world(FlightKind::kAgile), .effects = *effects, .seed = 1, .jobs = jobs, .later_s = later_s},
      folder, [](std::size_t, std::size_t) {});
}

}  // namespace epiline::test
