#pragma once
// The flight controller's IMU, over the link that also carries the odometry. Page: docs/flight-controller.md.
#include <atomic>

#include "drivers/links/mavlink/link.h"
#include "platform/ports/ports.h"

namespace epiline {

/// Body frame B: the vehicle's (forward, left, up). Timestamps of the flight controller are translated by TIMESYNC. The
/// link must be made with an IMU, outlive this object, and stay open from open() to close().
class MavlinkImu final : public ImuSource {
 public:
  explicit MavlinkImu(mavlink::MavlinkLink& link) : link_(link) {}

  /// Waits up to 15 s for the first sample. Fails if and only if none arrives; the error says what is missing.
  Status open() override;
  void give_up() noexcept override { gives_up_.store(true, std::memory_order_relaxed); }
  void close() noexcept override { gives_up_.store(false, std::memory_order_relaxed); }
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
    return link_.read_imu(samples, count, timeout);
  }

  mavlink::ControllerImuCounts counts() const noexcept { return link_.state().imu; }
  ClockState clock_state() const noexcept { return link_.clock_state(); }

 private:
  mavlink::MavlinkLink& link_;
  std::atomic<bool> gives_up_{false};
};

}  // namespace epiline
