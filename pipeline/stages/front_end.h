#pragma once
// Image in, tracked features out: the vision front end with its prediction from the gyroscope.
#include <cmath>

#include "estimator/estimator.h"
#include "pipeline/stages/gyro_rotation.h"
#include "pipeline/vision/tracker.h"

namespace epiline {

class FrontEnd {
 public:
  FrontEnd(const Camera& camera, const TrackerConfig& config, const Mat3& R_BC)
      : tracker_(camera, config),
        R_BC_(R_BC),
        half_readout_(Span::from_seconds(0.5 * std::abs(camera.parameters().readout_s))) {}

  /// A reading of the IMU; all up to an image's time should be here before its step.
  void add_imu(const ImuSample& sample) noexcept { gyro_.add(sample); }

  /// What the estimator knows by now: bias of the gyroscope, t_IMU - t_image.
  void set_knowledge(const Vec3& gyroscope_bias_rad_s, double time_offset_s) noexcept;

  /// As Tracker::step: the pixels of `image` must stay valid until the next call returns. A blind image (is_blind) is
  /// not looked at: it has no features, and the pixels of the one before it are needed on.
  void step(const Frame& image, TrackedFrame& out) noexcept;

  const TrackerStats& stats() const noexcept { return tracker_.stats(); }

 private:
  Tracker tracker_;
  GyroRotation gyro_;
  RowTurn rows_of(HostStamp exposure) const;

  Mat3 R_BC_;
  Span half_readout_;  ///< zero: global shutter
  Vec3 bias_rad_s_ = Vec3::Zero();
  Span time_offset_{};
  HostStamp previous_{};
  bool has_previous_ = false;
};

}  // namespace epiline
