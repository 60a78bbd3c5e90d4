#pragma once
// Interfaces of devices. Drivers implement them, stages use them. open() and close() belong to start-up and shut-down.
// All other calls are on the hot path: no heap, no exceptions, and no waiting beyond the given time-out.
#include <cstddef>
#include <cstdint>
#include <span>

#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

enum class ReadOutcome : std::uint8_t {
  kSample,   ///< samples were read
  kTimeout,  ///< no sample within the time-out; not an error
  kEnd,      ///< no more samples: a recording has ended
  kFailed,   ///< the device is lost; the driver tries to reopen it, so later calls may succeed
};

/// A camera. Images stay in the driver's buffers: read() lends one, give_back() returns it.
class CameraSource {
 public:
  virtual ~CameraSource() = default;
  virtual Status open() = 0;
  /// Returns all lent images to the driver, including those not given back.
  virtual void close() noexcept = 0;
  /// The oldest unread image, stamped at mid-exposure. `frame.data` stays valid until give_back(). `frame.sequence`
  /// counts all images that the camera took, so a gap means lost images. `frame.slot` is the number of the buffer, from
  /// 0.
  virtual ReadOutcome read(Frame& frame, Span timeout) noexcept = 0;
  /// The images that other cameras took at the same time as this one, which is lent; they are given back together with
  /// it.
  virtual OtherFrames others(const Frame& /*frame*/) const noexcept { return {}; }
  /// Returns an image. From any thread, once per image.
  virtual void give_back(const Frame& frame) noexcept = 0;
};

/// An inertial measurement unit: gyroscope and accelerometer on one clock.
class ImuSource {
 public:
  virtual ~ImuSource() = default;
  virtual Status open() = 0;
  /// From any thread: an open() that waits for a sample fails within 0.1 s, until close() is called. The default is for
  /// sources that do not wait.
  virtual void give_up() noexcept {}
  virtual void close() noexcept = 0;
  /// Writes up to samples.size() samples, in time order, and their number into `count`. kSample: count > 0.
  virtual ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span timeout) noexcept = 0;
};

/// A sensor besides camera and IMU; its samples are used as they come.
template <class Sample>
class SampleSource {
 public:
  virtual ~SampleSource() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  virtual ReadOutcome read(Sample& sample, Span timeout) noexcept = 0;
};
/// Wheel odometry of a ground vehicle.
using WheelSource = SampleSource<WheelSample>;
/// A barometer, a range finder, or both.
using HeightSource = SampleSource<HeightSample>;

/// A receiver of the odometry: a flight controller, a bus, a file. One thread makes all calls; the next IMU sample
/// waits until they return.
class OdometrySink {
 public:
  virtual ~OdometrySink() = default;
  virtual Status open() = 0;
  virtual void close() noexcept = 0;
  /// The state at an IMU sample, predicted from the last solved image. Called for each sample since the first pose, in
  /// time order; a sink that wants a lower rate drops some. The state moves smoothly unless `reset_counter` changes.
  /// False: not delivered; the caller counts it and continues.
  virtual bool publish(const Odometry& odometry) noexcept = 0;
  /// The state at an image, as soon as it is known. Its time lies before that of earlier calls of publish(). Only for
  /// sinks that want one pose per image; the default does nothing.
  virtual bool publish_image(const Odometry& /*odometry*/) noexcept { return true; }
};

}  // namespace epiline
