#pragma once
// Events of the estimator, for the replay in one thread and for the threads. Events of the input are in
// pipeline/watch/input_events.h.
#include <array>

#include "estimator/statistics.h"
#include "pipeline/stages/back_end.h"
#include "platform/log/event.h"

namespace epiline {

/// Compares the estimator's figures after a step with those before it. Belongs to the thread of the back end; no
/// heap.
class EstimatorEvents {
 public:
  explicit EstimatorEvents(EventRing& out) : out_(out) {}

  /// After each BackEnd::add_imu(sample).
  void after_imu(const ImuSample& sample, const BackEnd& back_end) noexcept;
  /// After each BackEnd::step(frame).
  void after_image(const TrackedFrame& frame, const BackEnd& back_end) noexcept;

 private:
  template <class... Arguments>
  void tell(HostStamp stamp, EventId id, Arguments... arguments) noexcept {
    out_.push(make_event(stamp, id, arguments...));
  }

  EventRing& out_;
  std::uint64_t gaps_ = 0, aside_ = 0;
  HostStamp last_imu_;
  HealthState state_ = HealthState::kInitialising;
  std::uint32_t resets_ = 0;
  LoadLevel level_ = LoadLevel::kFull;
  bool started_ = false;
  std::array<Severity, static_cast<std::size_t>(Suspect::kCount)> severity_{};
};

}  // namespace epiline
