#pragma once
// Image in, tracked features out: the vision front end with its prediction from the gyroscope.
#include <array>
#include <optional>

#include "estimator/estimator.h"
#include "pipeline/stages/gyro_rotation.h"
#include "pipeline/stages/knowledge.h"
#include "pipeline/vision/second_tracker.h"
#include "pipeline/vision/tracker.h"

namespace epiline {

/// Where a camera sits: x_B = R_BC x_C + p_BC.
struct CameraMount {
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();
};
inline CameraMount mount_of(const EstimatorConfig& e) { return {e.extrinsics.R_BC, e.extrinsics.p_BC}; }

/// Cameras 1 to 3, those that are there.
struct OtherLens {
  CameraParameters camera;
  CameraMount mount;
};
using OtherLenses = std::array<std::optional<OtherLens>, kMostOthers>;
/// Of cameras where the estimator's configuration says.
OtherLenses lenses_of(const std::array<std::optional<CameraParameters>, kMostOthers>& cameras, const EstimatorConfig&);

/// How far apart in time an image of another camera may be from the first one's; zero: taken as of the same time.
OtherSpans apart_of(const EstimatorConfig& estimator);

class FrontEnd {
 public:
  /// Each other camera looks for the tracks of the first camera before it, in the order of their numbers, with whose
  /// image its own can be compared (SecondTracker::why_apart). Throws std::invalid_argument for a tracker that cannot
  /// be built.
  FrontEnd(const Camera& camera, const TrackerConfig& config, const CameraMount& mount, const OtherLenses& others = {});

  /// A reading of the IMU; all up to an image's time should be here before its step.
  void add_imu(const ImuSample& sample) noexcept { gyro_.add(sample); }

  /// What the estimator knows by now.
  void set_knowledge(const Knowledge& known) noexcept;

  /// As Tracker::step: the pixels of `image` must stay valid until the next call returns. A blind image (is_blind) is
  /// not looked at: it has no features, and the pixels of the one before it are needed on.
  /// `others`: the other cameras' images of the same time, or nearly, with stamps of their own; without data: none. One
  /// that is blind counts as none. Their pixels must stay valid until the next call returns.
  void step(const Frame& image, const OtherFrames& others, TrackedFrame& out) noexcept;

  const TrackerStats& stats() const noexcept { return tracker_.stats(); }
  /// Of camera 1, 2 or 3; null without it.
  const SecondStats* other_stats(std::size_t camera) const noexcept;

 private:
  /// A camera of this rig: the first one, or another.
  struct Mounted {
    CameraMount mount;
    Span half_readout{};                  ///< zero: global shutter
    Span later{};                         ///< of its last image, after the frame's stamp
    std::optional<HostStamp> previous{};  ///< of the image that its tracker saw last
  };
  struct Other {
    Other(const Mounted& m, std::size_t camera, const Camera& C, const SecondRig& rig, const TrackerConfig& config,
          std::size_t number)
        : mounted(m), beside(camera), tracker(C, rig, config, number) {}
    Mounted mounted;
    std::size_t beside;  ///< number of the camera whose tracks it looks for
    SecondTracker tracker;
  };

  void add_other(std::size_t number, const Camera& first, const TrackerConfig& config, const OtherLenses& others);
  void step_other(std::size_t number, const PyramidView* first, HostStamp stamp, const Frame& image, TrackedFrame& out);
  const Mounted& camera(std::size_t number) const { return number == 0 ? first_ : others_[number - 1]->mounted; }
  RowTurn turn_within(const Mat3& R_BX, HostStamp image, Span within) const;
  RigMotion motion_of(const Mounted& first, const Mounted& second, HostStamp frame) const;
  Mat3 turn_since(const std::optional<HostStamp>& previous, const Mat3& R_BX, HostStamp image) const;

  Tracker tracker_;
  Mounted first_;
  std::array<std::optional<Other>, kMostOthers> others_;
  GyroRotation gyro_;
  Knowledge known_;
  Vec3 gyroscope_bias_rad_s_ = Vec3::Zero();
  Span time_offset_{};
};

}  // namespace epiline
