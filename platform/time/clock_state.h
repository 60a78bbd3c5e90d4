#pragma once
// What a model of a sensor's clock says of itself, for `check`, for health and for a report.
#include <array>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

enum class ClockStatus : std::uint8_t {
  kEmpty,     ///< no sample yet: nothing can be translated
  kSettling,  ///< translates; the skew is not known well yet
  kLocked,    ///< translates
  kUnusable,  ///< the clocks run apart faster than any crystal, or jump again and again: a wrong tick, a wrong clock
};

/// Names of it outside, in the order of the values.
inline constexpr std::array kClockStatusNames = {"empty", "settling", "locked", "unusable"};

/// What became of one sample.
enum class ClockOutcome : std::uint8_t {
  kUsed,
  kDuplicate,    ///< the device stamp of the sample before
  kDisordered,   ///< an earlier device stamp than the newest; translate() holds for it
  kSlow,         ///< two-way: the round trip was too long
  kLate,         ///< far too late for the model: a stall, for which translate() holds; or the device clock went back
  kContradicts,  ///< earlier than the model allows: a garbled stamp, or the device clock went on. Do not translate
  kJumped,       ///< the device clock has jumped; the model starts anew with this sample and its like
  kRefused,      ///< not is_clock_time(), or an answer before its question
};

/// Stamps of which differences, and differences of those, stay within 64 bits: until the year 2043.
template <class Clock>
constexpr bool is_clock_time(Stamp<Clock> stamp) {
  return stamp.ns > -(std::int64_t{1} << 60) && stamp.ns < (std::int64_t{1} << 61);
}

struct ClockState {
  ClockStatus status = ClockStatus::kEmpty;
  Span offset;          ///< host minus device clock, at the newest sample
  double skew_ppm = 0;  ///< how much faster the host clock runs
  /// Of the samples used in the window. One-way: delay beyond the least one. Two-way: middle of the exchange minus
  /// model.
  Span residual_rms, residual_most;
  Span bound;   ///< two-way: half of what round trips leave open; the true offset is within it. One-way: 0
  Span window;  ///< device time that the samples in use cover
  std::uint64_t samples = 0;  ///< all of them; each is counted below, unless it was part of a jump
  std::uint64_t used = 0, duplicates = 0, disordered = 0, slow = 0, late = 0, refused = 0;
  std::uint64_t outliers = 0;  ///< contradicted the model, and the next ones did not agree with them
  std::uint64_t jumps = 0;
};

}  // namespace epiline
