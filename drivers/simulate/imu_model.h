#pragma once
// An IMU made of its error model: reading = clamp(M truth + bias + white noise), the bias a random walk.
#include <limits>

#include "drivers/simulate/flights.h"
#include "drivers/simulate/random.h"
#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

namespace epiline {

struct ImuModel {
  double rate_hz = 200;
  ImuNoise noise;                      ///< set the four densities to zero for a perfect IMU
  double gyroscope_bias_sigma = 0.01;  ///< of the initial bias, each axis, rad/s
  double accelerometer_bias_sigma = 0.08;
  /// Scale and misalignment: what a reading of the truth alone would be, per unit of truth.
  Mat3 gyroscope_matrix = Mat3::Identity(), accelerometer_matrix = Mat3::Identity();
  double gyroscope_limit_rad_s = std::numeric_limits<double>::infinity();
  double accelerometer_limit_m_s2 = std::numeric_limits<double>::infinity();
};

class ImuSimulator {
 public:
  ImuSimulator(const ImuModel& model, const Random& random);
  /// The reading of this instant. Moves the biases on by one sampling interval afterwards.
  ImuSample read(HostStamp stamp, const Motion& motion);
  /// What the next reading will contain.
  const Vec3& gyroscope_bias() const { return b_g_; }
  const Vec3& accelerometer_bias() const { return b_a_; }

 private:
  ImuModel model_;
  Random random_;
  Vec3 b_g_, b_a_;
};

}  // namespace epiline
