#pragma once
// Initialises the states of a window of frames, at standstill or in motion.
#include <memory>
#include <optional>

#include "estimator/initialise/moving_start.h"
#include "estimator/window/window.h"

namespace epiline {

struct StarterSettings {
  double pixel_sigma = 0.5, focal_px = 458;
  double least_pixel_sigma = 0.5, most_pixel_sigma = 2;  ///< between these it is what the residuals show
  double b_g_sigma = 0.1;  ///< rad/s: standard deviation of the gyroscope bias before the first start
  double b_a_sigma = 0.1;  ///< m/s^2
  Vec3 b_g_reference = Vec3::Zero();
  Vec3 p_WB = Vec3::Zero();  ///< position of the newest frame after the start, m
  /// The heading is chosen as close to this attitude as possible; none: the body's x axis points along the world's.
  std::optional<Mat3> R_WB;
  double sigma_p = 0;    ///< standard deviation of p_WB, m; 0: exact by definition
  double sigma_yaw = 0;  ///< rad
  CalibrationTangent calibration_sigmas = CalibrationTangent::Zero();
  bool depth_is_measured = false;  ///< a range finder knows the scale: the guess need not
  Vec3 v_B = Vec3::Zero();         ///< the oldest frame's velocity, in its own body frame, m/s
  /// The inverse of its covariance.
  Mat3 v_B_information = 0.01 * Mat3::Identity();
};

class Starter {
 public:
  explicit Starter(InstructionSet set);
  ~Starter();
  /// Finds the states of all frames of the window from its tracks and IMU intervals, and puts a weak prior on the
  /// oldest frame. The states serve as linearisation point only; the window then weighs the same data. Empty: done.
  /// Otherwise the reason of the refusal, and the window is unchanged.
  std::optional<StartRefusal> start_moving(Window& window, const StarterSettings& settings);
  const StartGuess& guess() const;
  /// The next attempt searches anew.
  void forget();

 private:
  struct Memory;
  void collect_tracks(const Window& window);
  std::unique_ptr<Memory> memory_;
};

}  // namespace epiline
