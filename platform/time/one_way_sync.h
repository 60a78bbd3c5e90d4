#pragma once
// Translates device times to host time, from samples with a device time and their arrival times.
// Derivation: docs/derivations/clock_sync.md
#include <cstdint>

#include "platform/time/clock.h"
#include "platform/time/clock_state.h"
#include "platform/time/lower_envelope.h"

namespace epiline {

struct OneWaySettings {
  Span min_delay;  ///< smallest time from the device's timestamp to the arrival, from data sheets
  LowerEnvelope::Settings envelope;
  Span early = Span::from_milliseconds(2);         ///< so far ahead of a locked model a sample contradicts it ...
  std::uint64_t early_samples = 3;                 ///< ... and so many in a row that agree are a jump
  Span late = Span::from_milliseconds(10);         ///< so far behind the model a sample is late ...
  Span late_for = Span::from_milliseconds(1'000);  ///< ... and if all are for so long, it is a jump
};

/// arrival = host time of the device's timestamp + min_delay + a delay that is never negative. The model is therefore a
/// line below all samples of the window, not an average. Fixed memory, no clock; one thread.
///
/// Successive translated times may decrease: the model moves, usually by microseconds, at a clock jump by any amount.
class OneWaySync {
 public:
  explicit OneWaySync(const OneWaySettings& settings) noexcept;

  ClockOutcome update(DeviceStamp device, HostStamp arrival) noexcept;

  /// Requires is_clock_time(device). Before the first sample the number is returned unchanged.
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
