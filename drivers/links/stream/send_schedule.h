#pragma once
// When the next odometry is due.
#include <array>
#include <cstddef>
#include <cstdint>

namespace epiline {

/// Balances a steady rate with low latency of images. The first message that contains a new image is sent as soon as
/// the rate allows. Messages between images are spaced evenly so that the next image finds room, or left out if images
/// come about as often as messages.
///
/// With T = 1 / rate, two messages are at least T / 1.1 apart, and at most 1.5 T while there is something to send.
/// Times are monotonic_ns().
class SendSchedule {
 public:
  explicit SendSchedule(double rate_hz) noexcept;

  /// The first prediction with a new image is available.
  void image(std::int64_t now_ns) noexcept;
  void sent(std::int64_t now_ns) noexcept;
  /// The earliest time for the next message; `has_image`: it is the first one that contains a new image.
  std::int64_t due_ns(bool has_image) const noexcept;
  std::int64_t period_ns() const noexcept { return period_ns_; }

 private:
  std::int64_t image_interval_ns() const noexcept;

  static constexpr std::int64_t kRarely_ns = 500'000'000;  // images so far apart are none to wait for

  std::int64_t period_ns_, shortest_ns_, longest_ns_;
  std::int64_t last_sent_ns_ = -(std::int64_t{1} << 60), last_image_ns_ = -(std::int64_t{1} << 60);
  std::array<std::int64_t, 5> intervals_ns_{};  ///< of the last images
  std::size_t intervals_ = 0;                   ///< since images came rarely
};

}  // namespace epiline
