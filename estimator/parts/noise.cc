#include "estimator/parts/noise.h"

#include <cmath>

namespace epiline {

namespace {
constexpr double kMoved = 0.1;  // of a density: less is not worth weighing the window anew

bool has_moved(const ImuNoise& from, const ImuNoise& to) {
  const auto moved = [](double a, double b) { return std::abs(b - a) > kMoved * a; };
  return moved(from.gyroscope_density, to.gyroscope_density) ||
         moved(from.accelerometer_density, to.accelerometer_density) ||
         moved(from.gyroscope_random_walk, to.gyroscope_random_walk) ||
         moved(from.accelerometer_random_walk, to.accelerometer_random_walk);
}
}  // namespace

Noise::Noise(const EstimatorConfig& config) noexcept : config_(config), of_readings_(config.imu) {
  of_intervals_.noise = between_frames(of_readings_);
}

ImuNoise Noise::between_frames(const ImuNoise& of_readings) const noexcept {
  ImuNoise noise = in_flight(config_, of_readings);
  noise.accelerometer_random_walk *= accelerometer_walk_.factor();
  noise.gyroscope_random_walk *= gyroscope_walk_.factor();
  return noise;
}

bool Noise::hold() noexcept {
  const ImuNoise held = bounds_.hold(config_.imu), flown = between_frames(held);
  if (!has_moved(of_intervals_.noise, flown)) return false;
  of_readings_ = held;
  of_intervals_.noise = flown;
  return true;
}

bool Noise::learn_walks(HostStamp time, const NavState& x, const StateCovariance& P) noexcept {
  const ImuNoise& now = of_intervals_.noise;
  accelerometer_walk_.add(time, x.b_a, P.block<3, 3>(9, 9), now.accelerometer_random_walk);
  return gyroscope_walk_.add(time, x.b_g, P.block<3, 3>(12, 12), now.gyroscope_random_walk);
}

void Noise::restart() noexcept {
  accelerometer_walk_.restart();
  gyroscope_walk_.restart();
}

}  // namespace epiline
