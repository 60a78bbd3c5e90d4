#pragma once
// Interface of the observers of a flight: record, flight recorder, live view.
#include <cstdint>

#include "pipeline/stages/frame_outcome.h"
#include "pipeline/stages/hand_over.h"
#include "platform/log/event.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Called by the log thread, one call at a time; it is not a real-time thread. An observer that takes long loses
/// samples (they are counted), never the flight; still it should use no heap and no lock: the log thread is measured
/// like the others. Each stream comes in its own order; between streams there is none, but an image's outcome comes
/// before its tracks. Default: nothing.
class FlightObserver {
 public:
  virtual ~FlightObserver() = default;

  /// Every image that went through the estimator.
  virtual void take(const FrameOutcome& /*outcome*/) noexcept {}
  /// The odometry of that image was handed out; `latency_ns`: since the instant of its stamp.
  virtual void published(std::uint64_t /*serial*/, std::int64_t /*latency_ns*/) noexcept {}
  /// Every reading of the IMU, as it came from the device.
  virtual void imu(const ImuSample& /*sample*/) noexcept {}
  /// Every speed of the wheels.
  virtual void wheel(const WheelSample& /*sample*/) noexcept {}
  /// Every sample of the height sensors.
  virtual void height(const HeightSample& /*sample*/) noexcept {}
  /// The tracks of every image that went through the estimator.
  virtual void tracks(const LoggedTracks& /*tracks*/) noexcept {}
  /// An image that was tracked, and those of other cameras. The pixels are lent for this call.
  virtual void image(const Frame& /*frame*/, const OtherFrames& /*others*/) noexcept {}
  /// In the order of time, as far as 0.5 s of waiting can bring it about.
  virtual void event(const Event& /*event*/) noexcept {}
  /// Everything that had come was handed over; ten times a second or more often, also when nothing comes. `now`: on
  /// the samples' clock.
  virtual void pass(HostStamp /*now*/) noexcept {}

  /// Called once, before the flight: images are delivered only if an observer wants them.
  virtual bool wants_images() const noexcept { return false; }
};

}  // namespace epiline
