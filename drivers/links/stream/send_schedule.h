#pragma once
// When the next odometry is due.
#include <cstdint>

#include "drivers/links/stream/recent_median.h"

namespace epiline {

/// A receiver wants a steady stream; a vehicle wants what the camera just saw at once. So a message that is the first
/// with an image in it leaves as soon as the rate allows, and those between are laid so that the next image finds
/// room: evenly, or left out where images come about as often as messages.
///
/// With T = 1 / rate: never less than T / 1.1 between two, and never more than 1.5 T as long as there is something to
/// send. Times are monotonic_ns().
class SendSchedule {
 public:
  explicit SendSchedule(double rate_hz) noexcept;

  /// The first prediction with another image in it is there.
  void image(std::int64_t now_ns) noexcept;
  void sent(std::int64_t now_ns) noexcept;
  /// The earliest time for the next message; `has_image`: it would be the first with an image in it.
  std::int64_t due_ns(bool has_image) const noexcept;
  std::int64_t period_ns() const noexcept { return period_ns_; }

 private:
  static constexpr std::int64_t kRarely_ns = 500'000'000;  // images so far apart are none to wait for

  std::int64_t period_ns_, shortest_ns_, longest_ns_;
  std::int64_t last_sent_ns_ = -(std::int64_t{1} << 60), last_image_ns_ = -(std::int64_t{1} << 60);
  RecentMedian<5> intervals_ns_;  ///< of images
};

}  // namespace epiline
