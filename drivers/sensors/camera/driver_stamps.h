#pragma once
// Judges the timestamps of a V4L2 driver, and counts lost images by its sequence numbers. docs/camera.md
#include <cstdint>
#include <optional>

#include "platform/time/clock.h"

namespace epiline {

/// One thread, no heap, no clock.
class DriverStamps {
 public:
  /// Call when a stream begins. `is_our_clock`: the driver uses the kernel's monotonic clock; the offset of another
  /// clock is learned from the first image. `prepared`, `begun`: just before the driver was asked for buffers, and to
  /// start.
  void restart(bool is_our_clock, HostStamp prepared, HostStamp begun) noexcept;

  /// The image is older than the stream: no camera takes one between `prepared` and `begun`. v4l2loopback hands out the
  /// newest image that it still holds, stamped when the buffers were asked for, whatever clock its writer has.
  bool is_from_before(HostStamp given) const noexcept;

  /// Later than the one before, and not earlier on its way than any by more than `period`, of the images: drivers
  /// compute the end of a frame, and hand the image out before it. One stamp that is not so is wrong. Of several in a
  /// row, each later than the one before, it is the clock that was set.
  bool is_credible(HostStamp given, HostStamp arrival, Span period) noexcept;

  /// Counts the next image and returns the number of images lost before it. `driver_sequence` has 32 bits and restarts
  /// with each stream; some drivers never change it.
  std::uint32_t count(std::uint32_t driver_sequence) noexcept;
  /// Number of the newest image, counted over all streams.
  std::uint64_t sequence() const noexcept { return sequence_; }

 private:
  HostStamp prepared_, begun_;       ///< the stream
  HostStamp last_;                   ///< believed
  HostStamp last_doubted_;           ///< newest one that was not believed
  int doubted_ = 0;                  ///< in a row
  std::optional<Span> least_delay_;  ///< from a stamp to the image's arrival; the kernel's clock: at most 0

  std::uint64_t sequence_ = 0;
  std::uint32_t driver_sequence_ = 0;
  bool is_first_ = true, is_first_of_stream_ = true;
};

}  // namespace epiline
