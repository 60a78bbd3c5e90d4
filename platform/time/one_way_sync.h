#pragma once
// The host time of a device's stamps, from stamped samples and the times at which they arrived.
// Derivation: docs/derivations/clock_sync.md
#include <cstdint>

#include "platform/time/clock.h"
#include "platform/time/clock_state.h"
#include "platform/time/lower_envelope.h"

namespace epiline {

struct OneWaySettings {
  Span min_delay;  ///< the least time from the device's stamp to the arrival: transport, filters. Known, not measured
  LowerEnvelope::Settings envelope;
  Span early = Span::from_milliseconds(2);         ///< so far ahead of a locked model a sample contradicts it ...
  std::uint64_t early_samples = 3;                 ///< ... and so many in a row that agree are a jump
  Span late = Span::from_milliseconds(10);         ///< so far behind the model a sample is late ...
  Span late_for = Span::from_milliseconds(1'000);  ///< ... and if all are for so long, it is a jump
};

/// arrival = host time of the device's stamp + min_delay + something that is never negative. So the model is a line
/// below all samples of the window, never an average. Fixed memory, no clock of its own; one thread.
///
/// Times translated in a row need not rise: the model moves, mostly by microseconds, in a jump by any amount.
class OneWaySync {
 public:
  explicit OneWaySync(const OneWaySettings& settings) noexcept;

  ClockOutcome update(DeviceStamp device, HostStamp arrival) noexcept;

  /// `device` is_clock_time(). Before the first sample there is nothing to go by: the number is taken as it is.
  HostStamp translate(DeviceStamp device) const noexcept;
  ClockState state() const noexcept;

 private:
  ClockOutcome doubt(std::int64_t x_ns, std::int64_t y_ns, HostStamp arrival, bool is_late) noexcept;
  bool is_confirmed(std::int64_t x_ns, HostStamp arrival) const noexcept;
  void dismiss_doubt() noexcept;

  OneWaySettings settings_;
  LowerEnvelope envelope_;
  ClockState counts_;  ///< its counters only

  // Samples in a row that do not fit: perhaps the beginning of a new model.
  LowerHull doubtful_;
  bool doubtful_late_ = false;
  std::int64_t doubtful_y_ns_ = 0;
  HostStamp doubtful_since_;
};

}  // namespace epiline
