#include "pipeline/watch/imu_gate.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
constexpr double kByChance = 1e-8;  // equal values of an axis in a row: less likely than that, they are a limit
constexpr double kBeyond = 1.5;     // times the limit: calibration moves a limit by far less
constexpr double kRepeatMemory = 1.0 / 256, kLineMemory = 1.0 / 2048, kFirstLines = 64, kFewestRepeats = 0.005;
constexpr double kStraight = 1e-3;  // a step like the one before: interpolated between readings further apart
constexpr int kStuck = 5;           // equal readings in a row, all six values
constexpr Span kStuckTime = Span::from_milliseconds(20);
constexpr double kDriftLimit = 100e-6;

bool finite(const ImuSample& r) {
  return Vec3(r.angular_velocity_rad_s.data()).allFinite() && Vec3(r.specific_force_m_s2.data()).allFinite();
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
  if (clock_.in_doubt()) r.reasons |= bit(HealthReason::kImuClockJump);
  if (std::abs(clock_.drift()) > kDriftLimit) r.reasons |= bit(HealthReason::kImuClockDrift);
  return true;
}

/// Every reading counts, also one that is left out later. False: one that came before, and must not count twice.
bool ImuGate::straighten(ImuSample& r) noexcept {
  const bool again = r.stamp == last_raw_ && r.angular_velocity_rad_s == last_.angular_velocity_rad_s &&
                     r.specific_force_m_s2 == last_.specific_force_m_s2;
  if (again) return refuse(stats_.duplicate);
  last_raw_ = r.stamp;
  const HostStamp even = bursts_.step(r.stamp);
  if (bursts_.per_burst() > 0) ++stats_.straightened;
  r.stamp = even;
  return true;
}

/// Whether so many equal values are less likely than any that rounding and interpolation have shown so far.
bool ImuGate::is_limit(const Axis& axis) noexcept {
  const double goes_on = std::max(axis.goes_on, axis.repeats);
  return axis.same > 1 && axis.repeats * std::pow(goes_on, axis.same - 2) < kByChance;
}

/// From a row of equal values that has ended, and from a value after it that differs.
void ImuGate::learn_rows(Axis& axis, double value) noexcept {
  const int repeats = axis.same - 1;
  const double memory = std::max(kLineMemory, 1 / (kFirstLines + axis.lines));
  if (!is_limit(axis)) {
    if (repeats > 1) axis.goes_on = 1 - (1 - axis.goes_on) * std::pow(1 - memory, repeats - 1);
  }
  const bool on_line = repeats == 0 && std::abs(value - axis.last - axis.step) <= kStraight * std::abs(axis.step);
  if (axis.on_line || repeats > 0) {
    axis.goes_on += memory * ((on_line ? 1 : 0) - axis.goes_on);
    axis.lines += std::max(1, repeats);
  } else if (!on_line) {
    // what was never seen to go on is not expected to, unless rounding is so coarse that it soon will
    axis.goes_on -= kRepeatMemory * std::pow(1 - axis.repeats, 8) * axis.goes_on;
  }
  axis.goes_on = std::max(axis.goes_on, kFewestRepeats);
  axis.on_line = on_line;
  axis.step = value - axis.last;
  axis.same = 1;
}

bool ImuGate::saturated(const ImuSample& r) noexcept {
  bool any = false;
  for (std::size_t i = 0; i < 6; ++i) {
    Axis& axis = axes_[i];
    const double value = i < 3 ? r.angular_velocity_rad_s[i] : r.specific_force_m_s2[i - 3], size = std::abs(value);
    const bool repeated = value == axis.last;
    if (repeated)
      ++axis.same;
    else
      learn_rows(axis, value);
    axis.last = value;
    const bool clipped = is_limit(axis);
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

bool ImuGate::impossible(const ImuSample& r) const noexcept {
  const Vec3 w(r.angular_velocity_rad_s.data()), a(r.specific_force_m_s2.data());
  return is_impossible(w, a) || w.cwiseAbs().maxCoeff() > kBeyond * axes_[0].limit ||
         a.cwiseAbs().maxCoeff() > kBeyond * axes_[3].limit;
}

/// A single corrupt reading is bridged by all that integrate, and harms nothing; several a second are a broken sensor.
bool ImuGate::spikes_persist(const ImuSample& r) noexcept {
  const SpikeJudge::Verdict v = judge_.step(r.stamp, Vec3(r.angular_velocity_rad_s.data()),
                                            Vec3(r.specific_force_m_s2.data()), period_.step(r.stamp));
  if (v.past == SpikeJudge::Past::kSpikes) stats_.spikes += static_cast<std::uint64_t>(v.past_count);
  return judge_.persists();
}

bool ImuGate::step(ImuSample& r) noexcept {
  if (!straighten(r)) return false;
  if (!finite(r)) return refuse(stats_.not_finite);
  if (impossible(r)) return refuse(stats_.impossible);
  r.reasons = 0;
  if (!in_order(r)) return false;
  if (stuck(r)) {
    ++stats_.stuck;
    r.reasons |= bit(HealthReason::kImuStuck);
  } else if (saturated(r)) {
    ++stats_.saturated;
    r.reasons |= bit(HealthReason::kImuSaturated);
  }
  if (spikes_persist(r)) r.reasons |= bit(HealthReason::kReadingsRefused);
  r.reasons |= pending_;
  pending_ = 0;
  return true;
}

}  // namespace epiline
