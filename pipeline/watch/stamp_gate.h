#pragma once
// Detects jumps of a sensor's clock, by comparing timestamps with arrivals. Rules: docs/derivations/health.md.
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// Checks the timestamps of one sensor, whose driver delivers in order. No clock, no heap.
class StampGate {
 public:
  enum class Verdict : std::uint8_t {
    kUse,     ///< use corrected()
    kOld,     ///< not later than the last one: repeated or out of order
    kSuspect  ///< implausible; the next one decides whether the clock jumped or this timestamp was wrong
  };

  /// Judges one timestamp. `arrival`: on the computer's clock; zero: unknown, then only the order is checked.
  Verdict step(HostStamp stamp, HostStamp arrival) noexcept;

  HostStamp corrected() const noexcept { return last_; }
  /// Whether the clock jumped at the last used timestamp, and the current correction of timestamps.
  bool stepped() const noexcept { return stepped_; }
  Span correction() const noexcept { return correction_; }
  /// For some seconds after a jump: the correction is as good as the arrivals were punctual, and a wrong one takes that
  /// long to be named as a time offset.
  bool in_doubt() const noexcept { return correction_.ns != 0 && last_ - stepped_at_ < kDoubt; }
  /// Drift: seconds of timestamps per second of the computer, minus 1; zero at first.
  double drift() const noexcept { return drift_; }

 private:
  static constexpr Span kDoubt = Span::from_milliseconds(5'000);

  Span expected_step(Span since) const noexcept;
  void follow_drift(HostStamp arrival, Span lead) noexcept;
  Verdict use(HostStamp stamp, HostStamp arrival) noexcept;
  Verdict adopt(Span jump, HostStamp stamp, HostStamp arrival) noexcept;

  HostStamp last_, last_arrival_, stepped_at_;
  Span correction_{}, period_{}, reference_{}, suspected_{};
  bool any_ = false, stepped_ = false, suspicious_ = false;
  int learnt_ = 0;
  // drift: the largest lead of a window of time, and that of an earlier one
  HostStamp window_begin_, first_at_;
  Span window_lead_{}, first_lead_{};
  int windows_ = 0;
  double drift_ = 0;
};

}  // namespace epiline
