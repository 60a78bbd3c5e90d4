#pragma once
// The interface of the estimator: IMU samples and tracked frames in, odometry out. It uses no clock, thread or file,
// and no heap after construction. Not thread-safe: one thread calls it.
#include <memory>

#include "estimator/config.h"
#include "estimator/geometry/types.h"
#include "estimator/statistics.h"
#include "estimator/supervisor.h"
#include "platform/samples/samples.h"

namespace epiline {

/// What process() did with a frame.
struct StepResult {
  bool has_pose = false;  ///< odometry() holds an estimate for this frame
  bool solved = false;    ///< true: by optimisation; false: predicted by the IMU
};

class Estimator {
 public:
  /// Allocates all memory that the estimator will use.
  explicit Estimator(const EstimatorConfig& config);
  ~Estimator();
  Estimator(const Estimator&) = delete;
  Estimator& operator=(const Estimator&) = delete;

  /// Adds an IMU sample (body frame B), in time order. Samples may be ahead of the images by up to two seconds, at 1
  /// kHz or less: 4096 are kept, and a start needs those of the second before its image. Bad samples (old, repeated,
  /// not finite) are counted and left out; the result is then false.
  bool add_imu(const ImuSample& sample) noexcept;
  /// Adds a wheel speed, in time order; false: it was bad and is left out. The estimator interpolates it with the
  /// previous speed at the frames between the two that are still in the window. A speed may therefore come late; no
  /// frame waits for it.
  bool add_wheel(const WheelSample& sample) noexcept;
  /// Adds a sample of a height sensor, in time order for each kind; false: it was bad or out of the sensor's range and
  /// is left out. As with speeds, no frame waits for it.
  bool add_height(const HeightSample& sample) noexcept;
  /// The time of the IMU's clock up to which samples must have been added before process() of an image with this
  /// timestamp: its exposure, or its printed stamp if that is later, minus a fifth of an IMU interval. The last sample
  /// is held for that long, so an image just after a sample need not wait for the next one.
  HostStamp imu_needed_until(HostStamp image) const noexcept;
  /// Processes the tracks of one image; images in time order. `supervisor` limits the effort.
  StepResult process(const TrackedFrame& frame, Supervisor& supervisor) noexcept;
  /// What the odometry of that image need not wait for: the window makes room for the next frame. process() does it
  /// first where the caller has not. Returns whether a frame has become a keyframe.
  bool slide(Supervisor& supervisor) noexcept;
  /// Starts, or restarts, at this frame from a known state, without initialisation.
  void start(const TrackedFrame& frame, const InitialState& state) noexcept;

  /// The newest estimate; valid until the next call of process() or start().
  const Odometry& odometry() const noexcept;
  const EstimatorStats& stats() const noexcept;
  /// Estimated gyroscope bias, rad/s in B, for the tracker's prediction; zero before the start.
  Vec3 gyroscope_bias() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
