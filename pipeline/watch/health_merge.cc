#include "pipeline/watch/health_merge.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr Span kHold = Span::from_milliseconds(500);
constexpr double kQualityRise_s = 0.5;
constexpr int kBestWhenDegraded = 50;
/// What is worth saying, and no reason to trust the estimate less.
constexpr std::uint32_t kNotes = bit(HealthReason::kExposureStep);
// Silence: two and a half periods, and not less than what a busy computer may do to a thread.
constexpr Span kCameraPatience = Span::from_milliseconds(120), kImuPatience = Span::from_milliseconds(50);
constexpr Span kCameraLost = Span::from_milliseconds(2'000), kImuLost = Span::from_milliseconds(500);

bool silent(HostStamp heard, Span period, Span patience, HostStamp now) {
  return heard.ns != 0 && now - heard > std::max(patience, Span{5 * period.ns / 2});
}
}  // namespace

/// A silence counts as two periods: it must not become the usual one.
void LastHeard::hear(HostStamp stamp, HostStamp& last, Span& period) noexcept {
  if (last.ns != 0 && stamp > last) {
    const Span step = stamp - last;
    period = period.ns == 0 ? step : Span{period.ns + (std::min(step.ns, 2 * period.ns) - period.ns) / 16};
  }
  last = std::max(last, stamp);
}

std::uint32_t silent_sensors(const LastHeard& heard, HostStamp now) noexcept {
  std::uint32_t reasons = 0;
  if (silent(heard.camera, heard.camera_period, kCameraPatience, now)) reasons |= bit(HealthReason::kCameraSilent);
  if (silent(heard.imu, heard.imu_period, kImuPatience, now)) reasons |= bit(HealthReason::kImuSilent);
  return reasons;
}

Health with_silence(Health h, const LastHeard& heard, HostStamp now) noexcept {
  const std::uint32_t reasons = silent_sensors(heard, now);
  if (reasons == 0) return h;
  h.reasons |= reasons;
  if (h.state == HealthState::kTracking) h.state = HealthState::kDegraded;
  if (h.state == HealthState::kDegraded) h.quality = std::min(h.quality, kBestWhenDegraded);
  const bool too_long = silent(heard.camera, {}, kCameraLost, now) || silent(heard.imu, {}, kImuLost, now);
  if (too_long && h.state != HealthState::kInitialising) {
    h.state = HealthState::kLost;
    h.quality = -1;
  }
  return h;
}

Health HealthMerge::step(const Health& base, std::uint32_t input, HostStamp now) noexcept {
  Health h = base;
  h.reasons |= input;
  const std::uint32_t serious = h.reasons & ~kNotes;
  const bool bad = serious != 0 || base.state != HealthState::kTracking;
  if (bad) {
    bad_until_ = now + kHold;
    held_ = serious;
  }
  const bool held = now < bad_until_;
  if (held) h.reasons |= held_;
  if (h.state == HealthState::kTracking && held) h.state = HealthState::kDegraded;

  if (h.state == HealthState::kLost) {
    quality_ = 0;
    h.quality = -1;
  } else {
    const double best = h.state == HealthState::kDegraded ? std::min(base.quality, kBestWhenDegraded) : base.quality;
    const double dt_s = any_ ? std::max(0.0, (now - last_).seconds()) : kQualityRise_s;
    quality_ = best < quality_ ? best : quality_ + std::min(1.0, dt_s / kQualityRise_s) * (best - quality_);
    h.quality = static_cast<int>(std::lround(quality_));
  }
  any_ = true;
  last_ = now;
  return h;
}

}  // namespace epiline
