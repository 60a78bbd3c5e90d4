#pragma once
// Does a sensor's clock step? Stamps against arrivals. docs/derivations/health.md has the rules.
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

/// Follows the stamps of one sensor, whose driver delivers in order. No clock inside; no memory beyond a few numbers.
class StampGate {
 public:
  enum class Verdict : std::uint8_t {
    kUse,     ///< corrected() is the stamp to go on with
    kOld,     ///< not later than the last one: doubled or out of order
    kSuspect  ///< cannot be; the next one will tell whether the clock stepped or this one was wrong
  };

  /// One stamp and when it came, by the computer's clock; zero: nobody knows, then only the order is watched.
  Verdict step(HostStamp stamp, HostStamp arrival) noexcept;

  HostStamp corrected() const noexcept { return last_; }
  /// Whether the clock stepped with the last stamp used; and by how much stamps are moved now.
  bool stepped() const noexcept { return stepped_; }
  Span correction() const noexcept { return correction_; }
  /// Stamps' seconds per second of the computer minus 1; zero until some time has been seen.
  double drift() const noexcept { return drift_; }

 private:
  Span expected_step(Span since) const noexcept;
  void follow_drift(HostStamp arrival, Span lead) noexcept;
  Verdict use(HostStamp stamp, HostStamp arrival) noexcept;
  Verdict adopt(Span jump, HostStamp stamp, HostStamp arrival) noexcept;

  HostStamp last_, last_arrival_;
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
