#pragma once
#include <cstdint>

#include "platform/time/monotonic.h"

namespace epiline {

/// Nanoseconds of some clock, from outside: the stages hold no clock.
using NowNs = std::int64_t (*)() noexcept;

/// How long a part of the work took, or an instant on both clocks.
struct StageTime {
  std::int64_t wall_ns = 0;
  std::int64_t cpu_ns =
      0;  ///< processor time of the thread that did it: without the time it had to wait for a processor

  StageTime& operator+=(const StageTime& other) noexcept {
    wall_ns += other.wall_ns;
    cpu_ns += other.cpu_ns;
    return *this;
  }
  friend StageTime operator-(const StageTime& later, const StageTime& earlier) noexcept {
    return {later.wall_ns - earlier.wall_ns, later.cpu_ns - earlier.cpu_ns};
  }
};

/// The two clocks a stage is timed with. `wall` is monotonic; `cpu` counts the processor time of the calling thread.
struct StageClocks {
  NowNs wall = nullptr, cpu = nullptr;
  StageTime now() const noexcept { return {wall(), cpu()}; }
};

/// The stages' clocks, and where the samples' stamps lie on `clocks.wall`.
struct FlightClock {
  StageClocks clocks;
  const Pace* pace = nullptr;  ///< complete before the first step

  std::int64_t now_ns() const noexcept { return clocks.wall(); }
  HostStamp stamp_now() const noexcept { return pace->stamp_of(now_ns()); }
};

}  // namespace epiline
