#pragma once
// When the clock model of a flight controller is good enough for the times of its sensors.
#include <cstdint>

#include "platform/time/clock.h"
#include "platform/time/two_way_sync.h"

namespace epiline::mavlink {

inline constexpr Span kSensorForgotten = Span::from_milliseconds(2'000);  ///< silent so long: makes room for another

inline bool is_usable(const TwoWaySync& clock) noexcept {
  constexpr std::uint64_t kExchanges = 10;  // so many make a clock model
  const ClockState state = clock.state();
  const bool is_known = state.status == ClockStatus::kSettling || state.status == ClockStatus::kLocked;
  return is_known && state.used >= kExchanges;
}

/// Whether a sample of this time may arrive now.
inline bool is_recent(HostStamp sampled, HostStamp now) noexcept {
  constexpr Span kOldest = Span::from_milliseconds(500), kAhead = Span::from_milliseconds(5);
  const Span age = now - sampled;
  return age <= kOldest && age >= -kAhead;
}

/// Counts a message that is not taken.
inline bool refuse(std::uint64_t& count) noexcept {
  ++count;
  return false;
}

}  // namespace epiline::mavlink
