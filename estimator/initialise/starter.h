#pragma once
// Turns a window of frames without states into a started one: at rest, or in motion.
#include <memory>
#include <optional>

#include "estimator/initialise/moving_start.h"
#include "estimator/window/window.h"

namespace epiline {

struct StarterSettings {
  double pixel_sigma = 0.5, focal_px = 458;
  double most_pixel_sigma = 2;  ///< noise the start may assume where the residuals show more than pixel_sigma
  double b_g_sigma = 0.1;       ///< rad/s: what is known of the gyroscope bias before the first start
  double b_a_sigma = 0.1;       ///< m/s^2
  Vec3 b_g_reference = Vec3::Zero();
  Vec3 p_WB = Vec3::Zero();  ///< where the newest frame is put, m
  /// Its heading comes as close to this attitude as it can; none: its x axis points along the world's.
  std::optional<Mat3> R_WB;
  double sigma_p = 0;    ///< how well that place is known, m; 0: it is so by definition
  double sigma_yaw = 0;  ///< rad
  CalibrationTangent calibration_sigmas = CalibrationTangent::Zero();
};

class Starter {
 public:
  Starter();
  ~Starter();
  /// Finds the states of all frames of the window from its tracks and IMU intervals and puts a weak prior on the oldest
  /// frame: what is found is the point to linearise at, and the window weighs the same data properly. Empty: done;
  /// otherwise why not, and the window is as it was.
  std::optional<StartRefusal> start_moving(Window& window, const StarterSettings& settings);
  const StartGuess& guess() const;

 private:
  struct Memory;
  void collect_tracks(const Window& window);
  std::unique_ptr<Memory> memory_;
};

}  // namespace epiline
