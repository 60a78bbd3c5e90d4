#pragma once
// What a device must offer. Drivers implement these, stages use them, and neither knows the other. open() and close()
// belong to start-up and shut-down; the rest is on the way of a sample: no heap, no exception, and no wait beyond the
// time-out that was asked for.
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

enum class ReadOutcome : std::uint8_t {
  kSample,   ///< there is something
  kTimeout,  ///< nothing came in time; the device may still be well
  kEnd,      ///< nothing will come any more: a recording is over
  kFailed,   ///< the device is lost; the driver reopens it by itself, later reads may succeed
};

/// A camera. Images stay in the driver's buffers: read() lends one, give_back() returns it.
class CameraSource {
 public:
  virtual ~CameraSource() = default;
  virtual Status open() = 0;
  /// Returns every lent image to the driver, also those not given back.
  virtual void close() noexcept = 0;
  /// The oldest image not yet read. `frame.data` is valid until give_back(); stamped at mid-exposure; `sequence` counts
  /// the images the camera took, so a gap is a loss. `frame.slot` is the buffer's number, from 0.
  virtual ReadOutcome read(Frame& frame, Span timeout) noexcept = 0;
  /// From any thread, once per image read.
  virtual void give_back(const Frame& frame) noexcept = 0;
};

/// An inertial measurement unit, both sensors on one clock.
class ImuSource {
 public:
  virtual ~ImuSource() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  /// Fills `samples` from the front, in time order; `count` is how many. kSample: count > 0.
  virtual ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept = 0;
};

/// Wheel odometry of a ground vehicle.
class WheelSource {
 public:
  virtual ~WheelSource() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  virtual ReadOutcome read(WheelSample& sample, Span timeout) noexcept = 0;
};

/// Somebody who wants the estimate: a flight controller, a file. Both calls come from one thread, and the next reading
/// waits for their return.
class OdometrySink {
 public:
  virtual ~OdometrySink() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  /// The state at a reading of the IMU, predicted from the last solved image: one call for each reading since the first
  /// pose, in the order of time. Who wants fewer leaves some out. It moves smoothly unless `reset_counter` changes.
  /// False: not delivered. The caller counts it and goes on with the next.
  virtual bool publish(const Odometry& odometry) noexcept = 0;
  /// The state of an image, as the trajectory holds it, the moment it is known. Its instant is past: it lies before
  /// those of earlier calls of publish(). For who wants images' poses; others need nothing of it.
  virtual bool publish_image(const Odometry& /*odometry*/) noexcept { return true; }
};

}  // namespace epiline
