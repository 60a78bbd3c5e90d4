#pragma once
// Image in, tracked features out: the vision front end with its prediction from the gyroscope.
#include <cmath>
#include <optional>

#include "estimator/estimator.h"
#include "pipeline/stages/gyro_rotation.h"
#include "pipeline/vision/second_tracker.h"
#include "pipeline/vision/tracker.h"

namespace epiline {

/// The rig of the estimator's two cameras; none without a second lens.
std::optional<SecondRig> rig_of(const std::optional<CameraParameters>& second, const EstimatorConfig& estimator);

class FrontEnd {
 public:
  /// Throws std::invalid_argument for a tracker that cannot be built, or a second camera beside a rolling shutter.
  FrontEnd(const Camera& camera, const TrackerConfig& config, const Mat3& R_BC,
           const std::optional<SecondRig>& second = {});

  /// A reading of the IMU; all up to an image's time should be here before its step.
  void add_imu(const ImuSample& sample) noexcept { gyro_.add(sample); }

  /// What the estimator knows by now: bias of the gyroscope, t_IMU - t_image.
  void set_knowledge(const Vec3& gyroscope_bias_rad_s, double time_offset_s) noexcept;

  /// As Tracker::step: the pixels of `image` must stay valid until the next call returns. A blind image (is_blind) is
  /// not looked at: it has no features, and the pixels of the one before it are needed on.
  /// `second`: the second camera's image of the same time; without data: none. If it is blind, that counts as none. Its
  /// pixels must stay valid until the next call returns.
  void step(const Frame& image, const Frame& second, TrackedFrame& out) noexcept;

  const TrackerStats& stats() const noexcept { return tracker_.stats(); }
  const SecondStats* second_stats() const noexcept { return second_ ? &second_->stats() : nullptr; }

 private:
  Tracker tracker_;
  std::optional<SecondTracker> second_;
  GyroRotation gyro_;
  RowTurn rows_of(HostStamp exposure) const;

  Mat3 turn_of(const Mat3& R_BX, HostStamp from, HostStamp to) const;

  Mat3 R_BC_, R_BS_ = Mat3::Identity();
  Span half_readout_;  ///< zero: global shutter
  Vec3 bias_rad_s_ = Vec3::Zero();
  Span time_offset_{};
  std::optional<HostStamp> previous_, second_previous_;  ///< of the images that the trackers saw last
};

}  // namespace epiline
