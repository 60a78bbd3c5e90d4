#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// The accelerometer's readings at the gyroscope's times, by straight lines between its own. Times are those of one
/// clock for both. One thread, fixed memory.
template <class Clock>
class AccelMerge {
 public:
  using Vector = std::array<double, 3>;
  enum class Outcome : std::uint8_t {
    kMerged,
    kWait,   ///< the reading after that time has not come yet
    kNever,  ///< there is none before it, or a gap
  };

  explicit AccelMerge(Span longest_gap) noexcept : longest_gap_(longest_gap) {}
  void restart(Span longest_gap) noexcept {
    longest_gap_ = longest_gap;
    first_ = count_ = 0;
  }
  void set_longest_gap(Span longest_gap) noexcept { longest_gap_ = longest_gap; }

  /// A reading that is not later than the one before is left out (false). The oldest one goes if there is no room.
  bool add(Stamp<Clock> stamp, const Vector& value) noexcept {
    if (count_ > 0 && stamp <= at(count_ - 1).stamp) return false;
    if (count_ == kMost) drop();
    ++count_;
    at(count_ - 1) = {stamp, value};
    return true;
  }

  /// `stamp` must not go back from call to call.
  Outcome value_at(Stamp<Clock> stamp, Vector& value) noexcept {
    while (count_ >= 2 && at(1).stamp <= stamp) drop();
    if (count_ == 0) return Outcome::kWait;
    const Reading &before = at(0), &after = at(1);
    if (before.stamp > stamp) return Outcome::kNever;
    if (before.stamp == stamp) {
      value = before.value;
      return Outcome::kMerged;
    }
    if (count_ == 1) return Outcome::kWait;
    const Span gap = after.stamp - before.stamp;
    if (gap > longest_gap_) return Outcome::kNever;
    const double share = static_cast<double>((stamp - before.stamp).ns) / static_cast<double>(gap.ns);
    for (std::size_t i = 0; i < 3; ++i) value[i] = before.value[i] + share * (after.value[i] - before.value[i]);
    return Outcome::kMerged;
  }

 private:
  struct Reading {
    Stamp<Clock> stamp;
    Vector value{};
  };
  static constexpr std::size_t kMost = 512;

  Reading& at(std::size_t i) noexcept { return ring_[(first_ + i) % kMost]; }
  void drop() noexcept {
    first_ = (first_ + 1) % kMost;
    --count_;
  }

  Span longest_gap_;
  std::array<Reading, kMost> ring_{};
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace epiline
