#pragma once
// Combines the health of the estimator, the findings of the input watch, and silence of sensors. Rules:
// docs/derivations/health.md.
#include <cstdint>

#include "platform/samples/samples.h"

namespace epiline {

/// Times of the last samples and usual intervals of the sensors; zero: none, unknown.
struct LastHeard {
  HostStamp camera, imu;
  Span camera_period{}, imu_period{};

  void heard_image(HostStamp stamp) noexcept { hear(stamp, camera, camera_period); }
  void heard_imu(HostStamp stamp) noexcept { hear(stamp, imu, imu_period); }

 private:
  static void hear(HostStamp stamp, HostStamp& last, Span& period) noexcept;
};

class HealthMerge {
 public:
  /// `base`: the estimator's verdict. `input`: HealthReason bits of the samples since the last call. `now`: of the
  /// samples' clock; calls in time order. Degraded holds for half a second after the last reason.
  Health step(const Health& base, std::uint32_t input, HostStamp now) noexcept;

 private:
  bool any_ = false;
  HostStamp last_, bad_until_;
  std::uint32_t held_ = 0;
  double quality_ = 0;
};

/// Silent sensors, as HealthReason bits.
std::uint32_t silent_sensors(const LastHeard& heard, HostStamp now) noexcept;

/// Health while sensors are silent: degraded, or lost after 2 s without images or half a second without IMU samples.
Health with_silence(Health health, const LastHeard& heard, HostStamp now) noexcept;

}  // namespace epiline
