#pragma once
// The flight controller's own IMU, over the link that takes our odometry. Page: docs/mavlink.md.
#include "drivers/links/mavlink/link.h"
#include "platform/ports/ports.h"

namespace epiline {

/// Body frame B: the vehicle's, forward, left, up. Stamps come from the flight controller's, by TIMESYNC. The link must
/// outlive it, have been made for an IMU, and be open from open() to close().
class MavlinkImu final : public ImuSource {
 public:
  explicit MavlinkImu(mavlink::MavlinkLink& link) : link_(link) {}

  /// Waits for the first reading. Fails, after 15 s, if and only if there is none, and says what is missing.
  Status open() override;
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept override {
    return link_.read_imu(samples, count, timeout);
  }

  mavlink::ControllerImuCounts counts() const noexcept { return link_.state().imu; }
  ClockState clock_state() const noexcept { return link_.clock_state(); }

 private:
  mavlink::MavlinkLink& link_;
};

}  // namespace epiline
