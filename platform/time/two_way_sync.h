#pragma once
// The host time of a device's stamps, from questions and answers (MAVLink TIMESYNC).
// Derivation: docs/derivations/clock_sync.md
#include <array>
#include <cstdint>

#include "platform/time/clock.h"
#include "platform/time/clock_state.h"
#include "platform/time/lower_envelope.h"

namespace epiline {

struct TwoWaySettings {
  Span round_trip_most = Span::from_milliseconds(10);  ///< longer exchanges are not looked at
  LowerEnvelope::Settings envelope;
  Span tolerance =
      Span::from_milliseconds(1);  ///< an exchange that contradicts the model by more counts towards a jump
};

/// The device read its clock between the question and the answer, so each exchange bounds the offset from both sides.
/// The model is the middle between the lowest upper and the highest lower bound, both straight lines over the window:
/// the best halves of all exchanges, (sent + received - 2 device) / 2 if a single one has both. Right if the least
/// delays of both ways are equal; it errs by half their difference, which nobody can see. Fixed memory, no clock; one
/// thread.
class TwoWaySync {
 public:
  explicit TwoWaySync(const TwoWaySettings& settings) noexcept;

  /// `sent`: the question left; `device`: the device's clock in its answer; `received`: the answer came.
  ClockOutcome update(HostStamp sent, DeviceStamp device, HostStamp received) noexcept;

  /// `device` is_clock_time(). Before the first exchange there is nothing to go by: the number is taken as it is.
  HostStamp translate(DeviceStamp device) const noexcept;
  ClockState state() const noexcept;

 private:
  static constexpr std::size_t kConfirm = 3;  ///< exchanges in a row that contradict the model but not each other

  /// What an exchange says of host minus device clock at device time x.
  struct Bracket {
    std::int64_t x_ns = 0, least_ns = 0, most_ns = 0;
  };

  bool contradict(const Bracket& a, const Bracket& b) const noexcept;
  Bracket model_at(std::int64_t x_ns) const noexcept;
  void add(const Bracket& bracket, std::int64_t residual_ns) noexcept;
  ClockOutcome doubt(const Bracket& bracket) noexcept;

  TwoWaySettings settings_;
  LowerEnvelope most_, minus_least_;  ///< of the upper bounds, and of the lower bounds with their sign changed
  ClockState counts_;                 ///< its counters only
  std::array<Bracket, kConfirm> doubtful_{};
  std::size_t doubtful_count_ = 0;
};

}  // namespace epiline
