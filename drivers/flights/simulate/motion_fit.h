#pragma once
// A smooth motion that agrees with a recorded flight's ground truth and with its IMU. Method and figures:
// docs/hybrid-flights.md.
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/simulate/fit_report.h"
#include "drivers/flights/simulate/fitted_motion.h"
#include "estimator/inertial/preintegration.h"
#include "pipeline/text/trajectory.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

struct FitSettings {
  /// Distance of the splines' knots, s; 0: two readings of the IMU.
  double knot_interval_s = 0;
  double bias_interval_s = 1;  ///< distance of the biases' knots
  /// How far the ground truth is trusted, as white noise of this density; per pose that is density * sqrt(rate). Much
  /// looser than a motion capture system is: it has to hold the motion in place over many seconds only, where the IMU
  /// knows no better.
  double position_density = 1e-2;  ///< m/sqrt(Hz)
  double rotation_density = 5e-3;  ///< rad/sqrt(Hz)
  /// Standard deviations of what is unknown but constant, around nothing: the truth's world against gravity, the body
  /// the truth is about against the IMU, its clock against the IMU's.
  double tilt_sigma_rad = 0.05, mount_sigma_rad = 0.1, lever_sigma_m = 0.05, time_offset_sigma_s = 0.02;
  /// Without: the most probable motion, which takes the IMU's noise over short times for motion and so agrees with it
  /// better than the true one would. With (a seed): a random one, drawn with the probability that the measurements give
  /// it; it disagrees with the IMU as much as the true one.
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
