#pragma once
// Tracks that were recorded instead of images: what the vision front end would have said.
#include <array>
#include <cstdint>
#include <memory>

#include "estimator/geometry/camera.h"
#include "platform/samples/samples.h"

namespace epiline {

/// A point of a recorded track in one image.
struct TrackPoint {
  std::uint32_t id = 0;
  float u = 0, v = 0;  ///< raw pixels
};

/// Turns points into tracked frames: bearing and its derivative by the camera model, age and velocity from the image
/// before.
class RecordedTracks {
 public:
  explicit RecordedTracks(const Camera& camera) : camera_(camera) {}

  /// `points` of one instant, each id once; instants in time order. Points without a bearing, doubled ids and points
  /// beyond the capacity are left out and counted.
  void step(HostStamp stamp, const TrackPoint* points, std::size_t count, TrackedFrame& out) noexcept;

  std::uint64_t left_out() const noexcept { return left_out_; }

 private:
  const TrackedFeature* find_previous(std::uint32_t id) const noexcept;
  bool describe(const TrackPoint& point, double dt_s, TrackedFeature& feature) const noexcept;

  Camera camera_;
  HostStamp previous_stamp_{};
  FixedVector<TrackedFeature, kMaxFeatures> previous_;  ///< sorted by id
  std::uint64_t sequence_ = 0, left_out_ = 0;
};

}  // namespace epiline
