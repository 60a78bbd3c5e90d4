#pragma once
// A smooth motion that agrees with a recorded flight's ground truth and with its IMU. Method and figures:
// docs/developers/simulation.md.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/motion/fitted_motion.h"
#include "drivers/laboratory/simulate/fit_report.h"
#include "estimator/inertial/preintegration.h"
#include "pipeline/text/trajectory.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

struct FitSettings {
  /// Distance of the splines' knots, s; 0: two readings of the IMU.
  double knot_interval_s = 0;
  double bias_interval_s = 1;  ///< distance of the biases' knots
  /// Noise density assumed for the ground truth; the standard deviation per pose is density * sqrt(rate). It is much
  /// larger than that of a motion capture system, because the ground truth only has to bound the drift over many
  /// seconds.
  double position_density = 1e-2;  ///< m/sqrt(Hz)
  double rotation_density = 5e-3;  ///< rad/sqrt(Hz)
  /// Standard deviations of unknown constants with zero mean: tilt of the truth's world, pose of its body on the IMU,
  /// offset of its clock.
  double tilt_sigma_rad = 0.05, mount_sigma_rad = 0.1, lever_sigma_m = 0.05, time_offset_sigma_s = 0.02;
  /// Empty: fit the most probable motion, which contains the IMU's short-term noise as motion and agrees with the IMU
  /// better than the true motion. A seed: draw a random motion from the posterior, which disagrees with the IMU as much
  /// as the true one.
  std::optional<std::uint64_t> draw;
  double longest_gap_s = 3;  ///< of the ground truth
  double shortest_s = 5;     ///< of the time both IMU and truth cover
  /// For error messages: where the two came from.
  std::string imu_name = "IMU", truth_name = "ground truth";
};

struct MotionFit {
  FittedMotion motion;
  FitReport report;
};

/// Fits over the time that both cover. The motion's world is the truth's, turned upright; its body is the IMU. Fails if
/// and only if readings are not finite or not in order, have a hole of more than five periods, or cover too little of
/// the truth; the truth has a gap longer than allowed or quaternions far from unit length; or the fit does not
/// converge.
Result<MotionFit> fit_motion(const std::vector<ImuSample>& imu, const ImuNoise& noise, const Trajectory& truth,
                             const FitSettings& settings = {});

}  // namespace epiline
