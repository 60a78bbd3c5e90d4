#include "drivers/links/mavlink/controller_height.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/links/mavlink/controller_clock.h"
#include "platform/math/atmosphere.h"

namespace epiline::mavlink {

namespace {

constexpr double kMostHeight_m = 1e5;
constexpr std::uint8_t kDownwards = 25;     // MAV_SENSOR_ROTATION_PITCH_270
constexpr std::uint8_t kInvalidSignal = 1;  // of signal_quality; 0: not known
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

constexpr float kInterval_us = 50'000;
struct Asked {
  std::uint32_t message;
  HeightKind kind;
};
constexpr std::array kAskedFor{Asked{ScaledPressure::kId, HeightKind::kBarometer},
                               Asked{DistanceSensor::kId, HeightKind::kRangeFinder},
                               Asked{Altitude::kId, HeightKind::kBarometer}};

constexpr std::int64_t from_ms(std::uint32_t ms) { return std::int64_t{ms} * 1'000'000; }
constexpr std::uint32_t sensor_of(std::uint32_t message, std::uint8_t id) { return message << 8U | id; }

}  // namespace

bool ControllerHeight::is_mine(const Packet& packet) noexcept {
  constexpr std::array kAll{ScaledPressure::kId, ScaledPressure2::kId, ScaledPressure3::kId, DistanceSensor::kId,
                            Altitude::kId};
  return std::find(kAll.begin(), kAll.end(), packet.id) != kAll.end();
}

std::optional<ControllerHeight::Reading> ControllerHeight::reading_of(const Packet& packet) const noexcept {
  const auto by_pressure = [&](const auto& message) {
    const double hpa = message.press_abs;
    return Reading{HeightKind::kBarometer, sensor_of(packet.id, 0), from_ms(message.time_boot_ms),
                   is_air_pressure(hpa) ? height_between(kStandardPressure_hpa, hpa, air_deg_) : kNothing};
  };
  ScaledPressure first;
  ScaledPressure2 second;
  ScaledPressure3 third;
  if (unpack(packet, first)) return by_pressure(first);
  if (unpack(packet, second)) return by_pressure(second);
  if (unpack(packet, third)) return by_pressure(third);
  Altitude altitude;
  if (unpack(packet, altitude)) {
    const double metres = altitude.altitude_monotonic;
    const bool is_time = altitude.time_usec < (std::uint64_t{1} << 50U);  // 36 years
    return Reading{HeightKind::kBarometer, sensor_of(packet.id, 0),
                   is_time ? static_cast<std::int64_t>(altitude.time_usec) * 1000 : 0,
                   std::abs(metres) < kMostHeight_m ? metres : kNothing};
  }
  DistanceSensor distance;
  if (unpack(packet, distance) && distance.orientation == kDownwards) {
    const bool is_inside =
        distance.current_distance > distance.min_distance && distance.current_distance < distance.max_distance;
    const bool is_valid = is_inside && distance.signal_quality != kInvalidSignal;
    return Reading{HeightKind::kRangeFinder, sensor_of(packet.id, distance.id), from_ms(distance.time_boot_ms),
                   is_valid ? 0.01 * distance.current_distance : kNothing};
  }
  return std::nullopt;
}

bool ControllerHeight::take(const Packet& packet, const TwoWaySync& clock, HostStamp now,
                            HeightSample& sample) noexcept {
  const auto found = reading_of(packet);
  if (!found) return refuse(counts_.others);
  const Reading& reading = *found;
  Sensor& sensor = sensors_[static_cast<std::size_t>(reading.kind)];
  const bool is_free = sensor.last_arrival.ns == 0 || now - sensor.last_arrival > kSensorForgotten;
  if (reading.sensor != sensor.sensor && !is_free) return refuse(counts_.others);
  if (!std::isfinite(reading.metres)) return refuse(counts_.refused_values);
  if (!is_usable(clock)) return refuse(counts_.no_clock);
  const HostStamp stamp = clock.translate(DeviceStamp{reading.device_ns});
  if (!is_recent(stamp, now) || stamp <= sensor.last_stamp) return refuse(counts_.refused_times);
  sensor = {reading.sensor, now, stamp};
  ++(reading.kind == HeightKind::kBarometer ? counts_.heights : counts_.distances);
  sample = {stamp, reading.kind, reading.metres};
  return true;
}

std::optional<CommandLong> HeightRequest::question(const ControllerHeight& heights, Address to,
                                                   std::int64_t now_ns) noexcept {
  looked_ns_ = now_ns;
  for (std::size_t tried = 0; tried < kAskedFor.size(); ++tried) {
    const auto [message, kind] = kAskedFor[next_];
    next_ = (next_ + 1) % kAskedFor.size();
    const HostStamp last = heights.last_of(kind);
    const bool comes = last.ns != 0 && now_ns - last.ns < kSensorForgotten.ns;
    if (comes || !wanted_[static_cast<std::size_t>(kind)]) continue;
    return command_about(message, kSetMessageInterval, to, kInterval_us);
  }
  return std::nullopt;
}

}  // namespace epiline::mavlink
