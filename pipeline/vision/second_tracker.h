#pragma once
// Finds the tracks of one camera in the images of a second one, and follows tracks of its own there. Design and
// measurements: docs/developers/vision.md.
#include <cstdint>
#include <memory>
#include <span>

#include "estimator/geometry/camera.h"
#include "estimator/geometry/row_turn.h"
#include "estimator/geometry/types.h"
#include "pipeline/vision/image_view.h"
#include "pipeline/vision/tracker_config.h"
#include "platform/samples/samples.h"

namespace epiline {

/// The second camera S beside a first one, C: x_S = R_SC x_C + p_SC. C leads the cameras, or is one of the others.
struct SecondRig {
  CameraParameters camera;
  Mat3 R_SC = Mat3::Identity();
  Vec3 p_SC = Vec3::Zero();  ///< m
};

/// How the rig moves while its cameras take an image each. All zero: both expose all rows at the frame's stamp.
struct RigMotion {
  double second_later_s = 0;  ///< stamp of the second camera's image less the frame's, which the leading camera gives
  RowTurn first;              ///< of the first camera, from the frame's stamp on
  RowTurn second;             ///< of the second camera, from its own stamp on
  Vec3 velocity_C = Vec3::Zero();  ///< of the first camera at the frame's stamp, m/s
};

/// Counts since construction.
struct SecondStats {
  std::uint64_t images = 0;          ///< pairs given to step()
  std::uint64_t images_missing = 0;  ///< of those: without a second image, or one that is blind or of another size
  std::uint64_t tracks = 0;          ///< of the first camera, in images with a second one
  std::uint64_t views = 0;           ///< of those: seen by the second camera
  std::uint64_t tried = 0;           ///< searches for tracks without a view
  std::uint64_t matched = 0;         ///< of those: successful
  std::uint64_t followed = 0;        ///< searches for tracks that had a view in the second image before
  std::uint64_t lost = 0;            ///< of those: without success
  std::uint64_t off_plane = 0;       ///< found, but not near the epipolar plane
  std::uint64_t wrong_side = 0;      ///< found near the plane, but beyond infinity or nearer than the baseline
  std::uint64_t alone = 0;           ///< tracks of the second camera alone, in all its images
};

/// Follows each track in the second camera's images from where it was first matched, and others that the first camera
/// does not see: few while it sees well, many while it does not. Everything is allocated by the constructor; the same
/// input gives the same output.
class SecondTracker {
 public:
  static constexpr float kMostOffPlane_px = 1.5f;  ///< distance of a view from the epipolar plane

  /// Why two cameras have no tracks in common: they have no baseline, or their images differ so much in scale, or are
  /// turned so much against each other, that patches do not look alike. Null: they have.
  static const char* why_apart(const Camera& first, const SecondRig& rig);

  /// `number`: of the second camera, 1 to 3. Throws std::invalid_argument for cameras without tracks in common if
  /// config.second_features is 0, and for images smaller than 64x64.
  SecondTracker(const Camera& first, const SecondRig& rig, const TrackerConfig& config, std::size_t number = 1);
  ~SecondTracker();
  SecondTracker(const SecondTracker&) = delete;
  SecondTracker& operator=(const SecondTracker&) = delete;

  /// Fills `out.views` with views of `tracks`, which are the first camera's in the image of the pyramid `first`, in the
  /// order of their ids; and `out.alone`. `first` is null, and there are no tracks, if that camera shows nothing.
  /// `second` has no data if the second camera missed this image; its pixels must stay valid until the next call
  /// returns. `R_SS0`: as `R_CC0` of Tracker::step, of the second camera.
  void step(const PyramidView* first, std::span<const TrackedFeature> tracks, const Frame& second, const Mat3& R_SS0,
            OtherTracks& out, const RigMotion& motion = {}) noexcept;

  /// Of the last image; null if the camera missed it.
  const PyramidView* pyramid() const noexcept;

  const SecondStats& stats() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
