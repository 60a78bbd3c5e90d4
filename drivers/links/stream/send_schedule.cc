#include "drivers/links/stream/send_schedule.h"

#include <algorithm>

namespace epiline {

SendSchedule::SendSchedule(double rate_hz) noexcept
    : period_ns_(static_cast<std::int64_t>(1e9 / rate_hz)),
      shortest_ns_(static_cast<std::int64_t>(1e9 / (1.1 * rate_hz)) + 1),
      longest_ns_(static_cast<std::int64_t>(1.4e9 / rate_hz)) {}

void SendSchedule::image(std::int64_t now_ns) noexcept {
  const std::int64_t interval = now_ns - last_image_ns_;
  last_image_ns_ = now_ns;
  if (interval > kRarely_ns) {
    intervals_ = 0;
  } else {
    intervals_ns_[intervals_++ % intervals_ns_.size()] = interval;
  }
}

/// The median; 0: too few images came.
std::int64_t SendSchedule::image_interval_ns() const noexcept {
  if (intervals_ < intervals_ns_.size()) return 0;
  auto sorted = intervals_ns_;
  auto* const middle = sorted.begin() + sorted.size() / 2;
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

void SendSchedule::sent(std::int64_t now_ns) noexcept { last_sent_ns_ = now_ns; }

std::int64_t SendSchedule::due_ns(bool has_image) const noexcept {
  const std::int64_t earliest = last_sent_ns_ + shortest_ns_;
  if (has_image) return earliest;
  const std::int64_t plain = last_sent_ns_ + period_ns_, interval = image_interval_ns();
  if (interval <= 0 || last_sent_ns_ - last_image_ns_ > 3 * interval) return plain;
  // the first image that may be sent when it comes, and how long until then
  const std::int64_t images = std::max<std::int64_t>((earliest - last_image_ns_ + interval - 1) / interval, 1);
  const std::int64_t until = last_image_ns_ + images * interval - last_sent_ns_;
  // it may come a little later than expected
  if (until <= longest_ns_) return last_sent_ns_ + std::min(until + period_ns_ / 5, longest_ns_ + period_ns_ / 20);
  const std::int64_t piece = until / std::max<std::int64_t>(until / shortest_ns_, 1);
  return piece <= longest_ns_ ? last_sent_ns_ + piece : plain;
}

}  // namespace epiline
