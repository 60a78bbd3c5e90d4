#pragma once
// State of the model of a sensor's clock, for `check`, health and report.
#include <array>
#include <cstdint>

#include "platform/time/clock.h"

namespace epiline {

enum class ClockStatus : std::uint8_t {
  kEmpty,     ///< no sample yet: nothing can be translated
  kSettling,  ///< translates; the skew is not known well yet
  kLocked,    ///< translates
  kUnusable,  ///< the clocks drift apart faster than any crystal, or jump repeatedly: wrong tick or wrong clock
};

/// Names in files and messages, in the order of the values.
inline constexpr std::array kClockStatusNames = {"empty", "settling", "locked", "unusable"};

/// The outcome of one sample.
enum class ClockOutcome : std::uint8_t {
  kUsed,
  kDuplicate,    ///< the same device time as the previous sample
  kDisordered,   ///< an earlier device time than the newest; translate() is valid
  kSlow,         ///< two-way: the round trip was too long
  kLate,         ///< much later than the model allows: a stall (translate() is valid), or the device clock went back
  kContradicts,  ///< earlier than the model allows: corrupt timestamp, or the device clock jumped ahead. Do not
                 ///< translate
  kJumped,       ///< the device clock jumped; the model restarts with this sample
  kRefused,      ///< not is_clock_time(), or an answer before its request
};

/// Stamps of which differences, and differences of those, stay within 64 bits: until the year 2043.
template <class Clock>
constexpr bool is_clock_time(Stamp<Clock> stamp) {
  return stamp.ns > -(std::int64_t{1} << 60) && stamp.ns < (std::int64_t{1} << 61);
}

struct ClockState {
  ClockStatus status = ClockStatus::kEmpty;
  Span offset;          ///< host minus device clock, at the newest sample
  double skew_ppm = 0;  ///< how much faster the host clock runs than the device clock
  /// Of the samples used in the window. One-way: delay beyond the least one. Two-way: middle of the exchange minus
  /// model.
  Span residual_rms, residual_most;
  Span bound;   ///< two-way: half of what round trips leave open; the true offset is within it. One-way: 0
  Span window;  ///< device time that the samples in use cover
  std::uint64_t samples = 0;  ///< all samples; each is also counted below, unless it was part of a jump
  std::uint64_t used = 0, duplicates = 0, disordered = 0, slow = 0, late = 0, refused = 0;
  std::uint64_t outliers = 0;  ///< contradicted the model, without agreement of the next samples
  std::uint64_t jumps = 0;

  /// Counts an outcome of a single sample, and returns it.
  ClockOutcome count(ClockOutcome outcome) noexcept {
    constexpr std::uint64_t ClockState::*kCounters[] = {
        &ClockState::used, &ClockState::duplicates, &ClockState::disordered, &ClockState::slow, &ClockState::late,
        nullptr,           &ClockState::jumps,      &ClockState::refused};
    if (const auto counter = kCounters[static_cast<std::size_t>(outcome)]) ++(this->*counter);
    return outcome;
  }
};

}  // namespace epiline
