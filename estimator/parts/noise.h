#pragma once
// What readings of the IMU are weighed with. Derivation: docs/derivations/imu.md#noise-densities and
// #walk-of-the-biases.
#include "estimator/config.h"
#include "estimator/inertial/bias_walk.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/noise_bounds.h"

namespace epiline {

/// The configured noise within what the readings allow, with biases that walk as they are seen to.
class Noise {
 public:
  explicit Noise(const EstimatorConfig& config) noexcept;
  void add(const ImuSample& reading) noexcept { bounds_.add(reading); }
  /// Once for each image. True: it has moved so far that intervals are to be weighed anew.
  bool hold() noexcept;
  /// From a solved state. True: the gyroscope's bias walks far faster than was assumed.
  bool learn_walks(HostStamp time, const NavState& x, const StateCovariance& P) noexcept;
  /// The next state is another flight's. What was learned stays.
  void restart() noexcept;
  /// Whether the accelerometer scatters far more than its noise does.
  bool shakes() const noexcept { return bounds_.shakes(of_readings_.accelerometer_density); }
  const ImuNoise& of_readings() const noexcept { return of_readings_; }
  /// The same with the factors of a flight, for the intervals between frames.
  const ImuHistory::Density& of_intervals() const noexcept { return of_intervals_; }

 private:
  ImuNoise between_frames(const ImuNoise& of_readings) const noexcept;

  const EstimatorConfig& config_;
  NoiseBounds bounds_;
  BiasWalk accelerometer_walk_{4}, gyroscope_walk_{100};
  ImuNoise of_readings_;
  ImuHistory::Density of_intervals_;
};

}  // namespace epiline
