#pragma once
// Times of the attempts to reopen a lost device.
#include <algorithm>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// Attempts at growing intervals: each twice the previous one, up to a longest. Times are those of monotonic_ns().
class Backoff {
 public:
  Backoff(Span first, Span longest) noexcept : first_(first), longest_(longest), next_(first) {}

  /// The device was lost: an attempt is due at once, which is enough after a transfer error. Call failed() as well if
  /// it cannot succeed yet.
  void begin(std::int64_t now_ns) noexcept {
    due_ns_ = now_ns;
    next_ = first_;
  }
  /// The attempt failed, or the device was lost again.
  void failed(std::int64_t now_ns) noexcept {
    due_ns_ = now_ns + next_.ns;
    next_ = std::min(Span{2 * next_.ns}, longest_);
  }
  std::int64_t due_ns() const noexcept { return due_ns_; }

 private:
  Span first_, longest_, next_;
  std::int64_t due_ns_ = 0;
};

}  // namespace epiline
