#pragma once
// A rate limit.
#include <algorithm>
#include <cstdint>

namespace epiline {

/// Token bucket: `per_second` on average, `at_once` in a burst. Times are monotonic_ns().
class TokenBucket {
 public:
  TokenBucket(double per_second, double at_once) noexcept
      : per_ns_(per_second * 1e-9), most_(at_once), tokens_(at_once) {}

  /// How much may be taken now.
  double available(std::int64_t now_ns) noexcept {
    if (now_ns > last_ns_) {
      tokens_ = std::min(most_, tokens_ + per_ns_ * static_cast<double>(now_ns - last_ns_));
      last_ns_ = now_ns;
    }
    return tokens_;
  }
  bool take(double count, std::int64_t now_ns) noexcept {
    if (available(now_ns) < count) return false;
    spend(count);
    return true;
  }
  /// Also more than there is: it has to come back first.
  void spend(double count) noexcept { tokens_ -= count; }
  /// When `count` will be there again.
  std::int64_t ready_ns(double count) const noexcept {
    return last_ns_ + static_cast<std::int64_t>(std::max(count - tokens_, 0.0) / per_ns_);
  }

 private:
  double per_ns_, most_, tokens_;
  std::int64_t last_ns_ = 0;
};

}  // namespace epiline
