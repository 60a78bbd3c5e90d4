#pragma once
// When a frame came, by the computer's monotonic clock. The kernel tells it by its clock of day, or the interface by a
// clock of its own.
#include <cstdint>

#include "platform/time/clock_state.h"
#include "platform/time/one_way_sync.h"

namespace epiline {

/// The two clocks of the computer, read at the same moment.
struct ClockPair {
  std::int64_t of_day_ns = 0, steady_ns = 0;
  static ClockPair now() noexcept;
};

/// What the kernel says of one frame; 0: nothing.
struct ArrivalStamps {
  std::int64_t of_day_ns = 0;    ///< SO_TIMESTAMPING, software
  std::int64_t hardware_ns = 0;  ///< raw, of the interface's own clock
};

/// One thread.
class ArrivalClock {
 public:
  ArrivalClock() noexcept;

  /// The arrival of a frame that is read at `now`. Never later than `now`, and not earlier than the previous frame's.
  /// An arrival more than a second ago counts as wrong: the result is then `now`, and bad_stamps() increases by one.
  HostStamp arrival(const ArrivalStamps& stamps, const ClockPair& now) noexcept;

  std::uint64_t bad_stamps() const noexcept { return bad_stamps_; }
  /// Of the interface's clock; empty if there is none.
  ClockState hardware_state() const noexcept { return hardware_.state(); }

 private:
  std::int64_t software_arrival(std::int64_t of_day_ns, const ClockPair& now) noexcept;

  OneWaySync hardware_;
  std::int64_t offset_ns_ = 0;  ///< clock of day minus monotonic, at the frame before
  bool has_offset_ = false;
  std::int64_t last_ns_ = 0;
  std::uint64_t bad_stamps_ = 0;
};

}  // namespace epiline
