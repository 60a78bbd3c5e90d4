#pragma once
// The estimator from outside: IMU samples and tracked frames in, odometry out. Mathematics only: no clock, thread, file
// or, after construction, heap.
#include <memory>

#include "estimator/config.h"
#include "estimator/geometry/types.h"
#include "estimator/statistics.h"
#include "estimator/supervisor.h"
#include "platform/samples/samples.h"

namespace epiline {

struct StepResult {
  bool has_pose = false;  ///< `odometry()` holds an estimate for this frame
  bool solved = false;    ///< otherwise predicted with the IMU
  bool keyframe = false;
};

class Estimator {
 public:
  /// Allocates everything it will ever use.
  explicit Estimator(const EstimatorConfig& config);
  ~Estimator();
  Estimator(const Estimator&) = delete;
  Estimator& operator=(const Estimator&) = delete;

  /// IMU readings in time order; bad ones (old, doubled, not finite) are counted and left out. False: left out.
  bool add_imu(const ImuSample& sample) noexcept;
  /// A speed of the wheels, in time order; bad ones are left out: false. It serves the frames whose time lies between
  /// this one and the one before, if they are still in the window: so a speed may come late, and none is waited for.
  bool add_wheel(const WheelSample& sample) noexcept;
  /// The IMU time up to which readings must have been added before a frame of this stamp is processed: the frame's,
  /// less a fifth of an IMU interval. A frame just past a reading need not wait for the next one: the last one holds so
  /// long.
  HostStamp imu_needed_until(HostStamp image) const noexcept;
  /// One image's tracks, in time order.
  StepResult process(const TrackedFrame& frame, Supervisor& supervisor) noexcept;
  /// Starts (or starts anew) at this frame from a known state, without any search.
  void start(const TrackedFrame& frame, const InitialState& state) noexcept;

  const Odometry& odometry() const noexcept;
  const EstimatorStats& stats() const noexcept;
  /// Current bias estimate for the tracker's prediction; zero before the start.
  Vec3 gyroscope_bias() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
