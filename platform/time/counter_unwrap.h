#pragma once
// A device's counter of few bits becomes a time that does not wrap. Derivation: docs/derivations/clock_sync.md
#include <cstdint>

#include "platform/error/contract.h"
#include "platform/time/clock.h"

namespace epiline {

/// The length of one count as a fraction of nanoseconds: 1 us is {1000, 1}, 39.0625 us is {78125, 2}.
struct Tick {
  std::int64_t ns = 1, per = 1;
};

/// The turns that a counter of `Bits` bits has made are those for which the sample is not later than its arrival
/// allows, as seen from the sample that came with the least delay. So gaps longer than a turn are bridged, bursts after
/// a stall keep their times, and samples out of order or twice do no harm. Right while delays vary by less than three
/// quarters of a turn, and the clocks part by less than a quarter of a turn within a gap.
template <int Bits>
class CounterUnwrap {
  static_assert(Bits >= 8 && Bits <= 40, "more bits do not wrap within a flight");

 public:
  explicit CounterUnwrap(Tick tick) noexcept : tick_(tick) {
    EPILINE_EXPECTS(tick.ns > 0 && tick.per > 0 && tick.ns <= 1'000'000 * tick.per, "a tick of at most 1 ms");
  }

  /// `raw`: the counter, higher bits are ignored; `arrival`: when it was read. The first sample is turn 0.
  DeviceStamp unwrap(std::uint64_t raw, HostStamp arrival) noexcept {
    raw &= kTurn - 1;
    if (!started_) {
      started_ = true;
      reference_ = {static_cast<std::int64_t>(raw), arrival};
      return stamp_of(reference_.count);
    }
    const std::int64_t expected = reference_.count + counts_within(arrival - reference_.arrival);
    const std::int64_t latest = expected + static_cast<std::int64_t>(kTurn / 4);
    // the greatest count <= latest whose low bits are raw
    const std::int64_t count =
        latest - static_cast<std::int64_t>((static_cast<std::uint64_t>(latest) - raw) & (kTurn - 1));
    if (count >= expected) reference_ = {count, arrival};
    return stamp_of(count);
  }

  void restart() noexcept { started_ = false; }

 private:
  static constexpr std::uint64_t kTurn = std::uint64_t{1} << Bits;
  struct Reference {
    std::int64_t count = 0;
    HostStamp arrival;
  };

  /// A little less than the host clock says, 244 ppm: then the reference follows a device clock that is slower.
  std::int64_t counts_within(Span elapsed) const noexcept {
    if (elapsed.ns <= 0) return 0;
    const std::int64_t slack_ns = elapsed.ns / 4096;
    const double ns = static_cast<double>(elapsed.ns - slack_ns);
    return static_cast<std::int64_t>(ns * static_cast<double>(tick_.per) / static_cast<double>(tick_.ns));
  }
  DeviceStamp stamp_of(std::int64_t count) const noexcept {
    std::int64_t whole = count / tick_.per, rest = count % tick_.per;
    if (rest < 0) --whole, rest += tick_.per;
    return {whole * tick_.ns + rest * tick_.ns / tick_.per};
  }

  Tick tick_;
  bool started_ = false;
  Reference reference_;  ///< the sample with the least delay lately
};

}  // namespace epiline
