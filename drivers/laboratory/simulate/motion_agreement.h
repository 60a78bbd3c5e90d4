#pragma once
// How well a motion agrees with IMU readings, over single readings and as an odometry sees them: integrated.
#include <vector>

#include "drivers/flights/motion/fitted_motion.h"
#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Rms over the axes of what the readings say minus what the motion says, and what the noise densities predict.
struct Agreement {
  double rms = 0, predicted = 0;
};

/// Residuals of single readings, biases removed.
struct SampleAgreement {
  Agreement gyroscope, accelerometer;               ///< rad/s, m/s^2
  double gyroscope_p95 = 0, accelerometer_p95 = 0;  ///< of the absolute value, one axis
};
SampleAgreement sample_agreement(const FittedMotion& motion, const std::vector<ImuSample>& imu, const ImuNoise& noise);

/// Readings integrated from poses of the motion over `interval_s` against its poses there, back to back. The biases are
/// those at the beginning of each interval.
struct IntegratedAgreement {
  double interval_s = 0;
  int count = 0;
  Agreement rotation, velocity, position;  ///< rad, m/s, m
  /// Of all nine together with their covariance, per degree of freedom; 1 is ideal. And of the three parts alone.
  double nees = 0, nees_rotation = 0, nees_velocity = 0, nees_position = 0;
};
IntegratedAgreement integrated_agreement(const FittedMotion& motion, const std::vector<ImuSample>& imu,
                                         const ImuNoise& noise, double interval_s);

}  // namespace epiline
