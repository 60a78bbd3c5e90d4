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

/// How far apart images of both cameras may be; zero: taken as of the same time.
inline Span apart_of(const EstimatorConfig& estimator) {
  constexpr double kRounding_s = 1e-6;
  const double apart_s = estimator.second.apart_s;
  return Span::from_seconds(apart_s > 0 ? apart_s + kRounding_s : 0);
}

/// What the front end knows of the estimate.
struct FrontEndKnowledge {
  Vec3 gyroscope_bias_rad_s = Vec3::Zero();
  double time_offset_s = 0;        ///< t_IMU - t_image
  HostStamp stamp{};               ///< of the following velocity, on the IMU's clock
  Vec3 velocity_B = Vec3::Zero();  ///< m/s; zero: not known
};

class FrontEnd {
 public:
  /// Throws std::invalid_argument for a tracker that cannot be built.
  FrontEnd(const Camera& camera, const TrackerConfig& config, const Mat3& R_BC,
           const std::optional<SecondRig>& second = {});

  /// A reading of the IMU; all up to an image's time should be here before its step.
  void add_imu(const ImuSample& sample) noexcept { gyro_.add(sample); }

  /// What the estimator knows by now.
  void set_knowledge(const FrontEndKnowledge& known) noexcept;

  /// As Tracker::step: the pixels of `image` must stay valid until the next call returns. A blind image (is_blind) is
  /// not looked at: it has no features, and the pixels of the one before it are needed on.
  /// `second`: the second camera's image of the same time, or nearly, with a stamp of its own; without data: none. If
  /// it is blind, that counts as none. Its pixels must stay valid until the next call returns.
  void step(const Frame& image, const Frame& second, TrackedFrame& out) noexcept;

  const TrackerStats& stats() const noexcept { return tracker_.stats(); }
  const SecondStats* second_stats() const noexcept { return second_ ? &second_->stats() : nullptr; }

 private:
  Tracker tracker_;
  std::optional<SecondTracker> second_;
  GyroRotation gyro_;
  RowTurn turn_within(const Mat3& R_BX, HostStamp image, Span within) const;
  RigMotion motion_of(HostStamp image, HostStamp second) const;

  Mat3 turn_of(const Mat3& R_BX, HostStamp from, HostStamp to) const;

  Mat3 R_BC_, R_BS_ = Mat3::Identity();
  Span half_readout_, half_readout_of_second_{};  ///< zero: global shutter
  FrontEndKnowledge known_;
  Span time_offset_{};
  std::optional<HostStamp> previous_, second_previous_;  ///< of the images that the trackers saw last
};

}  // namespace epiline
