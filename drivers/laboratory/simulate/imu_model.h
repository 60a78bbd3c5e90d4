#pragma once
// An IMU made of its error model: reading = clamp(M truth + bias + vibration + white noise), the bias a random
// walk.
#include <limits>
#include <optional>
#include <vector>

#include "drivers/flights/motion/random.h"
#include "drivers/laboratory/simulate/flights.h"
#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

namespace epiline {

/// A vibration of the sensor that is not part of the body's motion, as from a rotor. Above half the sampling rate it is
/// aliased, as with a real sensor.
struct VibrationLine {
  double frequency_hz = 0;
  double acceleration_m_s2 = 0, rate_rad_s = 0;  ///< amplitudes, along and about the axis
  Vec3 axis = Vec3::UnitZ();                     ///< unit vector in B
  double phase_rad = 0;                          ///< of the sine, at the first reading
};

struct ImuModel {
  double rate_hz = 200;
  ImuNoise noise;                      ///< set the four densities to zero for a perfect IMU
  double gyroscope_bias_sigma = 0.01;  ///< of the initial bias, each axis, rad/s
  double accelerometer_bias_sigma = 0.08;
  /// Scale and misalignment: maps the true value to the measured one.
  Mat3 gyroscope_matrix = Mat3::Identity(), accelerometer_matrix = Mat3::Identity();
  double gyroscope_limit_rad_s = std::numeric_limits<double>::infinity();
  double accelerometer_limit_m_s2 = std::numeric_limits<double>::infinity();
  std::vector<VibrationLine> vibrations;
};

/// A matrix of ImuModel with random errors: relative ones of each axis' scale, and the angles between the axes.
Mat3 random_axes(double scale_sigma, double misalignment_sigma_rad, Random& random);

/// Errors of a simulated IMU, as set on the command line.
struct ImuEffects {
  double noise_factor = 1, bias_factor = 1;            ///< times what the densities say; times the usual first biases
  double scale_sigma = 0, misalignment_sigma_rad = 0;  ///< see random_axes()
  double vibration_hz = 0;                             ///< 0: none
  double gyroscope_limit_rad_s = std::numeric_limits<double>::infinity();
  double accelerometer_limit_m_s2 = std::numeric_limits<double>::infinity();
};

/// The model of an IMU of that noise with these effects; a vibration has 2 m/s^2 and 0.02 rad/s and a random axis.
ImuModel imu_model_with(const ImuEffects& effects, const ImuNoise& noise, double rate_hz, Random random);

class ImuSimulator {
 public:
  ImuSimulator(const ImuModel& model, const Random& random);
  /// The sample at this time. Then advances the biases by one sampling interval.
  ImuSample read(HostStamp stamp, const Motion& motion);
  /// What the next reading will contain.
  const Vec3& gyroscope_bias() const { return b_g_; }
  const Vec3& accelerometer_bias() const { return b_a_; }

 private:
  ImuModel model_;
  Random random_;
  Vec3 b_g_, b_a_;
  std::optional<HostStamp> first_;
};

}  // namespace epiline
