#pragma once
// The flight controller's barometer and range finder, over the link that also carries the odometry. Page:
// docs/height.md.
#include "drivers/links/mavlink/link.h"
#include "platform/ports/ports.h"

namespace epiline {

/// Timestamps of the flight controller are translated by TIMESYNC. The link must be made to want heights, outlive this
/// object, and stay open from open() to close().
class MavlinkHeight final : public HeightSource {
 public:
  explicit MavlinkHeight(mavlink::MavlinkLink& link) : link_(link) {}

  /// Waits for nothing: a flight goes on without heights.
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(HeightSample& sample, Span timeout) noexcept override { return link_.read_height(sample, timeout); }

  mavlink::ControllerHeightCounts counts() const noexcept { return link_.state().heights; }
  ClockState clock_state() const noexcept { return link_.clock_state(); }

 private:
  mavlink::MavlinkLink& link_;
};

}  // namespace epiline
