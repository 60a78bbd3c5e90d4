#pragma once
// Standstill from raw IMU readings. The thresholds and what they separate: docs/derivations/imu.md.
#include <array>

#include "estimator/inertial/preintegration.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Readings of a short window. Standard deviations are of single readings about the window's mean, root mean square of
/// axes.
struct ImuStatistics {
  int count = 0;
  double duration_s = 0;                    ///< first to last reading
  Vec3 mean_rate = Vec3::Zero();            ///< rad/s; at rest the gyroscope bias
  Vec3 mean_specific_force = Vec3::Zero();  ///< m/s^2; at rest gravity's reaction and the accelerometer bias, in B
  double sigma_rate = 0, sigma_specific_force = 0;
};

/// Keeps the newest IMU samples and tests whether they vary no more than noise does. An IMU cannot distinguish rest
/// from unaccelerated motion without rotation; a caller that must distinguish them also needs the camera.
class StationaryDetector {
 public:
  explicit StationaryDetector(const ImuNoise& noise, double window_s = 0.5) : noise_(noise), window_s_(window_s) {}

  void assume(const ImuNoise& noise) noexcept { noise_ = noise; }
  /// Adds a sample, with a later timestamp. A gap of more than a fifth of the window restarts the window. Of a sensor
  /// above 2 kHz, the mean of neighbours counts as one reading.
  void add(const ImuSample& sample) noexcept;
  void clear() noexcept { count_ = 0; }
  ImuStatistics statistics() const noexcept;
  /// Of at least 90 % of the window.
  bool is_filled(const ImuStatistics& s) const noexcept;
  /// False while the window is not filled. Ignores the mean rate, because it may be a bias.
  bool is_stationary() const noexcept { return is_stationary(statistics()); }
  bool is_stationary(const ImuStatistics& s) const noexcept;

 private:
  static constexpr std::size_t kCapacity = 1024;  // half a second at 2 kHz
  struct Reading {
    HostStamp stamp;  ///< of the first of them
    Vec3 w, a;        ///< mean
    int samples = 0;
  };
  /// The i-th newest reading, 0 the newest.
  const Reading& newest(std::size_t i) const { return readings_[(count_ - 1 - i) % kCapacity]; }
  void join(const Reading& reading);
  /// Readings that lie in the window.
  std::size_t in_window() const;

  ImuNoise noise_;
  double window_s_;
  std::array<Reading, kCapacity> readings_;
  std::size_t count_ = 0;
};

}  // namespace epiline
