#pragma once
// When to try again to open a device that was lost.
#include <algorithm>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// Attempts at growing intervals: each twice the one before, up to the longest. Instants are those of monotonic_ns().
class Backoff {
 public:
  Backoff(Span first, Span longest) noexcept : first_(first), longest_(longest), next_(first) {}

  /// Lost: an attempt is due at once, for a fault of a transfer needs no more than a new start. Who knows better says
  /// failed() besides.
  void begin(std::int64_t now_ns) noexcept {
    due_ns_ = now_ns;
    next_ = first_;
  }
  /// So did the attempt, or it did not last.
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
