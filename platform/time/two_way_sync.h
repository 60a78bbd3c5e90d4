#pragma once
// Translates device times to host time, from requests and answers (MAVLink TIMESYNC).
// Derivation: docs/derivations/clock_sync.md
#include <array>
#include <cstdint>

#include "platform/time/clock.h"
#include "platform/time/clock_state.h"
#include "platform/time/lower_envelope.h"

namespace epiline {

struct TwoWaySettings {
  Span round_trip_most = Span::from_milliseconds(10);  ///< longer exchanges are ignored
  LowerEnvelope::Settings envelope;
  /// An exchange that contradicts the model by more counts towards a jump.
  Span tolerance = Span::from_milliseconds(1);
};

/// The device reads its clock between request and answer, so each exchange bounds the offset from both sides. The model
/// is the middle between the lowest upper and the highest lower bound, both straight lines over the window; for a
/// single exchange this is (sent + received - 2 device) / 2. It is exact if the smallest delays of both directions are
/// equal, and otherwise wrong by half their difference, which cannot be observed. Fixed memory, no clock; one thread.
class TwoWaySync {
 public:
  explicit TwoWaySync(const TwoWaySettings& settings) noexcept;

  /// `sent`: when the request was sent; `device`: the device's clock in the answer; `received`: when the answer
  /// arrived.
  ClockOutcome update(HostStamp sent, DeviceStamp device, HostStamp received) noexcept;

  /// Requires is_clock_time(device). Before the first exchange the number is returned unchanged.
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
  void dismiss_doubt() noexcept;

  TwoWaySettings settings_;
  LowerEnvelope most_, minus_least_;  ///< of the upper bounds, and of the lower bounds with their sign changed
  ClockState counts_;                 ///< its counters only
  std::array<Bracket, kConfirm> doubtful_{};
  std::size_t doubtful_count_ = 0;
};

}  // namespace epiline
