#pragma once
// Which timestamps of a V4L2 driver are believed, and which image its sequence numbers tell of. docs/camera.md
#include <cstdint>
#include <optional>

#include "platform/time/clock.h"

namespace epiline {

/// One thread, no heap, no clock.
class DriverStamps {
 public:
  /// A stream begins. `is_our_clock`: the driver stamps by the kernel's clock; of another one the first image tells.
  void restart(bool is_our_clock) noexcept;

  /// Later than the one before, and not earlier on its way than any by more than `period`, of the images: drivers
  /// compute the end of a frame, and hand the image out before it. One stamp that is not so is wrong. Of several in a
  /// row, each later than the one before, it is the clock that was set.
  bool is_credible(HostStamp given, HostStamp arrival, Span period) noexcept;

  /// The next image, by the driver's number of it, which counts 32 bits, begins anew with each stream, and with some
  /// drivers does not move at all. Returns how many were lost before it.
  std::uint32_t count(std::uint32_t driver_sequence) noexcept;
  /// Of the newest image, over all streams.
  std::uint64_t sequence() const noexcept { return sequence_; }

 private:
  HostStamp last_;                   ///< believed
  HostStamp last_doubted_;           ///< and not believed
  int doubted_ = 0;                  ///< in a row
  std::optional<Span> least_delay_;  ///< from a stamp to the image's arrival; the kernel's clock: at most 0

  std::uint64_t sequence_ = 0;
  std::uint32_t driver_sequence_ = 0;
  bool is_first_ = true, is_first_of_stream_ = true;
};

}  // namespace epiline
