#include "pipeline/watch/imu_gate.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kByChance = 1e-8;  // equal values of an axis in a row: less likely than that, they are a limit
constexpr double kRepeatMemory = 1.0 / 256, kFewestRepeats = 0.005;
constexpr int kStuck = 5;  // equal readings in a row, all six values
constexpr Span kStuckTime = Span::from_milliseconds(20);
constexpr double kDriftLimit = 100e-6;

bool finite(const ImuSample& r) {
  const auto ok = [](double x) { return std::isfinite(x); };
  return std::all_of(r.angular_velocity_rad_s.begin(), r.angular_velocity_rad_s.end(), ok) &&
         std::all_of(r.specific_force_m_s2.begin(), r.specific_force_m_s2.end(), ok);
}
}  // namespace

ImuGate::ImuGate(const ImuLimits& limits) noexcept {
  for (std::size_t i = 0; i < 6; ++i) axes_[i].limit = i < 3 ? limits.gyroscope_rad_s : limits.accelerometer_m_s2;
}

bool ImuGate::refuse(std::uint64_t& counter) noexcept {
  ++counter;
  pending_ |= bit(HealthReason::kReadingsRefused);
  return false;
}

bool ImuGate::in_order(ImuSample& r) noexcept {
  switch (clock_.step(r.stamp, r.arrival)) {
    case StampGate::Verdict::kSuspect:
      return refuse(stats_.suspect);
    case StampGate::Verdict::kOld:
      return refuse(r.stamp + clock_.correction() == clock_.corrected() ? stats_.duplicate : stats_.out_of_order);
    case StampGate::Verdict::kUse:
      break;
  }
  r.stamp = clock_.corrected();
  if (clock_.stepped()) {
    ++stats_.clock_steps;
    r.reasons |= bit(HealthReason::kImuClockJump);
  }
  if (clock_.correction().ns != 0) r.reasons |= bit(HealthReason::kImuClockJump);
  if (std::abs(clock_.drift()) > kDriftLimit) r.reasons |= bit(HealthReason::kImuClockDrift);
  return true;
}

bool ImuGate::saturated(const ImuSample& r) noexcept {
  bool any = false;
  for (std::size_t i = 0; i < 6; ++i) {
    Axis& axis = axes_[i];
    const double value = i < 3 ? r.angular_velocity_rad_s[i] : r.specific_force_m_s2[i - 3], size = std::abs(value);
    const bool repeated = value == axis.last;
    axis.same = repeated ? axis.same + 1 : 1;
    axis.last = value;
    const bool clipped = std::pow(axis.repeats, axis.same - 1) < kByChance;
    if (!clipped) axis.repeats += kRepeatMemory * ((repeated ? 1 : 0) - axis.repeats);
    axis.repeats = std::max(axis.repeats, kFewestRepeats);
    any = any || clipped || size >= axis.limit;
  }
  return any;
}

bool ImuGate::stuck(const ImuSample& r) noexcept {
  const bool same =
      r.angular_velocity_rad_s == last_.angular_velocity_rad_s && r.specific_force_m_s2 == last_.specific_force_m_s2;
  if (!same) same_since_ = r.stamp;
  same_ = same ? same_ + 1 : 1;
  last_ = r;
  return same_ >= kStuck && r.stamp - same_since_ >= kStuckTime;
}

bool ImuGate::step(ImuSample& r) noexcept {
  if (!finite(r)) return refuse(stats_.not_finite);
  r.reasons = 0;
  if (!in_order(r)) return false;
  if (stuck(r)) {
    ++stats_.stuck;
    r.reasons |= bit(HealthReason::kImuStuck);
  } else if (saturated(r)) {
    ++stats_.saturated;
    r.reasons |= bit(HealthReason::kImuSaturated);
  }
  r.reasons |= pending_;
  pending_ = 0;
  return true;
}

}  // namespace epiline
