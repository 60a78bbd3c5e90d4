#include "estimator/inertial/stationary.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {

constexpr double kFilled = 0.9;  // of the window
constexpr double kGap = 0.2;     // of the window
constexpr int kFewestReadings = 20;
// Against the noise density: sensors of real vehicles are noisier than their data sheet.
constexpr double kNoiseMargin = 3;
constexpr double kRateFloor = 0.002;  // rad/s
constexpr double kForceFloor = 0.03;  // m/s^2

}  // namespace

void StationaryDetector::add(const ImuSample& sample) noexcept {
  const Reading reading{sample.stamp, Vec3(sample.angular_velocity_rad_s.data()),
                        Vec3(sample.specific_force_m_s2.data()), 1};
  const double since_s = count_ > 0 ? (sample.stamp - newest(0).stamp).seconds() : 0;
  if (since_s > kGap * window_s_) clear();
  // so that a window always has room; white noise keeps its density
  if (count_ > 0 && since_s * kCapacity < window_s_) return join(reading);
  readings_[count_++ % kCapacity] = reading;
}

void StationaryDetector::join(const Reading& reading) {
  Reading& mean = readings_[(count_ - 1) % kCapacity];
  const double share = 1.0 / ++mean.samples;
  mean.w += share * (reading.w - mean.w);
  mean.a += share * (reading.a - mean.a);
}

std::size_t StationaryDetector::in_window() const {
  const std::size_t stored = std::min(count_, kCapacity);
  std::size_t n = 0;
  while (n < stored && (newest(0).stamp - newest(n).stamp).seconds() <= window_s_) ++n;
  return n;
}

ImuStatistics StationaryDetector::statistics() const noexcept {
  ImuStatistics s;
  const std::size_t n = in_window();
  if (n < kFewestReadings) return s;
  const double count = static_cast<double>(n);
  s.count = static_cast<int>(n);
  s.duration_s = (newest(0).stamp - newest(n - 1).stamp).seconds();
  for (std::size_t i = 0; i < n; ++i) {
    s.mean_rate += newest(i).w / count;
    s.mean_specific_force += newest(i).a / count;
  }
  double w2 = 0, a2 = 0;
  for (std::size_t i = 0; i < n; ++i) {
    w2 += (newest(i).w - s.mean_rate).squaredNorm();
    a2 += (newest(i).a - s.mean_specific_force).squaredNorm();
  }
  s.sigma_rate = std::sqrt(w2 / (3 * (count - 1)));
  s.sigma_specific_force = std::sqrt(a2 / (3 * (count - 1)));
  return s;
}

bool StationaryDetector::is_filled(const ImuStatistics& s) const noexcept {
  return s.count >= kFewestReadings && s.duration_s >= kFilled * window_s_;
}

bool StationaryDetector::is_stationary(const ImuStatistics& s) const noexcept {
  if (!is_filled(s)) return false;
  const double root_rate = std::sqrt((s.count - 1) / s.duration_s);
  const double w_limit = kRateFloor + kNoiseMargin * noise_.gyroscope_density * root_rate;
  const double a_limit = kForceFloor + kNoiseMargin * noise_.accelerometer_density * root_rate;
  return s.sigma_rate < w_limit && s.sigma_specific_force < a_limit;
}

}  // namespace epiline
