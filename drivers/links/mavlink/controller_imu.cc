#include "drivers/links/mavlink/controller_imu.h"

#include <algorithm>
#include <cmath>

#include "drivers/links/mavlink/controller_clock.h"
#include "drivers/links/mavlink/odometry.h"

namespace epiline::mavlink {

namespace {

constexpr double kRateMost_rad_s = 70, kForceMost_m_s2 = 400;  // twice what the largest ranges give
constexpr Span kClosest{200'000};                              // no flight controller sends 5000 a second
constexpr std::uint16_t kBothSensors = 0x3f;                   // of HIGHRES_IMU's fields_updated

bool is_plausible(const std::array<double, 3>& v, double most) noexcept {
  return std::all_of(v.begin(), v.end(), [&](double x) { return std::abs(x) <= most; });  // false for what is no number
}

/// Older ArduPilots count RAW_IMU's microseconds in 32 bits: the turn nearest to `now`.
std::uint64_t unwrapped(std::uint64_t time_us, const TwoWaySync& clock, HostStamp now) noexcept {
  constexpr double kTurn = 4294967296.0;
  if (time_us >= (std::uint64_t{1} << 32U)) return time_us;
  const double device_us = 1e-3 * static_cast<double>(now.ns - clock.translate(DeviceStamp{0}).ns);
  const double turns = std::round((device_us - static_cast<double>(time_us)) / kTurn);
  return turns > 0 && turns < 1e6 ? time_us + (static_cast<std::uint64_t>(turns) << 32U) : time_us;
}

}  // namespace

/// Of several sensors the first that came is kept as long as it comes.
bool ControllerImu::is_preferred(bool is_highres, std::uint8_t id, HostStamp now) noexcept {
  const bool is_same = is_highres == is_highres_ && id == id_;
  const bool is_better = is_highres && !is_highres_;
  const bool is_free = last_of_sensor_.ns == 0 || now - last_of_sensor_ > kSensorForgotten;
  if (!is_same && !is_better && !is_free) return refuse(counts_.others);
  is_highres_ = is_highres;
  id_ = id;
  last_of_sensor_ = now;
  return true;
}

bool ControllerImu::take(const HighresImu& message, const TwoWaySync& clock, HostStamp now,
                         ImuSample& sample) noexcept {
  if (!is_preferred(true, message.id, now)) return false;
  if ((message.fields_updated & kBothSensors) != kBothSensors) return refuse(counts_.refused_values);
  sample = imu_sample(message);
  return accept(message.time_usec, clock, now, sample);
}

bool ControllerImu::take(const RawImu& message, const TwoWaySync& clock, HostStamp now, ImuSample& sample) noexcept {
  if (!is_preferred(false, message.id, now)) return false;
  sample = imu_sample(message);
  return accept(unwrapped(message.time_usec, clock, now), clock, now, sample);
}

bool ControllerImu::accept(std::uint64_t time_us, const TwoWaySync& clock, HostStamp now, ImuSample& sample) noexcept {
  if (!is_plausible(sample.angular_velocity_rad_s, kRateMost_rad_s) ||
      !is_plausible(sample.specific_force_m_s2, kForceMost_m_s2))
    return refuse(counts_.refused_values);
  if (!is_usable(clock)) return refuse(counts_.no_clock);
  if (time_us > (std::uint64_t{1} << 50U)) return refuse(counts_.refused_times);  // 36 years
  if (time_us == last_time_us_) return refuse(counts_.duplicates);
  const HostStamp given = clock.translate(DeviceStamp{static_cast<std::int64_t>(time_us) * 1000});
  if (!is_recent(given, now)) return refuse(counts_.refused_times);
  const HostStamp stamp = given - delay_;
  const Span interval = stamp - last_stamp_;
  if (interval <= Span{}) return refuse(counts_.duplicates);
  if (interval < kClosest) return refuse(counts_.refused_times);
  if (last_stamp_.ns != 0) counts_.lost += interval_.note(interval.ns);
  last_time_us_ = time_us;
  last_stamp_ = stamp;
  sample.stamp = stamp;
  sample.arrival = now;
  ++counts_.readings;
  return true;
}

}  // namespace epiline::mavlink
