#pragma once

namespace epiline {

/// Continuous-time noise densities of an IMU.
struct ImuNoise {
  double gyroscope_density = 1.6968e-4;       ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 1.9393e-5;   ///< rad/s^2/sqrt(Hz)
  double accelerometer_density = 2.0e-3;      ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 3.0e-3;  ///< m/s^3/sqrt(Hz)
};

}  // namespace epiline
