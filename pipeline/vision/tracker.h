#pragma once
// The vision front end: an image in, tracked features out. Design and measurements: docs/developers/vision.md.
#include <array>
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

/// Follows features from image to image. Everything is allocated by the constructor; the same input gives the same
/// output.
class Tracker {
 public:
  /// Images must have the camera's size, at least 64x64. Throws std::invalid_argument for a constant out of its range.
  /// `number`: of the camera, for its mask.
  Tracker(const Camera& camera, const TrackerConfig& config, std::size_t number = 0);
  ~Tracker();
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  /// `R_CC0` takes a bearing of the previous image's camera frame to this image's (from the gyroscope; identity if
  /// unknown). `out` holds all tracks of this image, new ones (age 0) included, old ones first. An image of the wrong
  /// size leaves it empty and ends all tracks. The pixels of `image` must stay valid until the next call returns.
  /// `rows`: of a rolling shutter, how the camera turned during the image.
  void step(const Frame& image, const Mat3& R_CC0, TrackedFrame& out, const RowTurn& rows = {}) noexcept;

  /// step() in two halves, for images in which other tracks are followed, too. follow(): finds the tracks again; false:
  /// the image cannot be used, and all tracks have ended. fill(), after true: adds new ones until there are `most` (0:
  /// none), none of them near the pixels `taken`, which also end tracks that they are on; then appends all tracks to
  /// `out`, with ids from `first_id` on.
  bool follow(const Frame& image, const Mat3& R_CC0, const RowTurn& rows = {}) noexcept;
  void fill(std::span<const std::array<float, 2>> taken, int most, std::uint32_t first_id,
            FixedVector<TrackedFeature, kMaxFeatures>& out) noexcept;

  /// Whether the camera sees the world there, by its mask.
  bool sees(float x, float y) const noexcept;

  const TrackerStats& stats() const noexcept;
  /// Of the last image that was tracked, and of the one before; valid as long as their pixels.
  const PyramidView& pyramid() const noexcept;
  const PyramidView& pyramid_before() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace epiline
