#pragma once
// Timestamps of readings that arrive several at a time and are stamped then, as behind a USB or serial line that waits
// for a full packet. Rules: docs/derivations/health.md.
#include <array>
#include <optional>

#include "platform/time/one_way_sync.h"

namespace epiline {

/// Recognises bursts, and from then on gives each reading the time at which an even clock would have taken it. No heap.
class BurstStamps {
 public:
  /// Of each reading, before any other use of the timestamp. As long as no bursts are known the timestamp stays.
  HostStamp step(HostStamp stamp) noexcept;

  /// Readings of a burst on average; 0: these are no bursts.
  double per_burst() const noexcept { return clock_ ? per_burst_ : 0; }

 private:
  static constexpr int kLearn = 64;

  void learn(HostStamp stamp) noexcept;
  void recognise() noexcept;
  void count(HostStamp stamp) noexcept;

  std::array<HostStamp, kLearn> learnt_{};
  int learnt_count_ = 0;
  double per_burst_ = 0;
  std::optional<OneWaySync> clock_;  ///< of the readings, counted in periods
  Span period_{};
  DeviceStamp counted_;
  HostStamp last_, last_given_;
};

}  // namespace epiline
