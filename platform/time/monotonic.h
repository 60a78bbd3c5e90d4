#pragma once
#include <chrono>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// The computer's monotonic clock, ns. Stages do not call it: the caller gives them their clock.
inline std::int64_t monotonic_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Maps timestamps of samples to the computer's monotonic clock. In a live flight they are equal; a recording is
/// shifted to now, and may be played faster or slower.
struct Pace {
  HostStamp stamp;           ///< this stamp ...
  std::int64_t host_ns = 0;  ///< ... is this instant of monotonic_ns()
  double speed = 1;          ///< seconds of stamps in one second

  std::int64_t host_of(HostStamp s) const noexcept {
    const std::int64_t since = (s - stamp).ns;
    return host_ns + (speed == 1 ? since : static_cast<std::int64_t>(static_cast<double>(since) / speed));
  }
  /// The other way round.
  HostStamp stamp_of(std::int64_t instant_ns) const noexcept {
    const std::int64_t since = instant_ns - host_ns;
    return stamp + Span{speed == 1 ? since : static_cast<std::int64_t>(static_cast<double>(since) * speed)};
  }
};

}  // namespace epiline
