#pragma once
// Zero motion seen by camera and gyroscope together. Derivation: docs/derivations/zero_motion.md.
#include <array>
#include <cstdint>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Compares each frame's bearings with a copy half a second old: a slow drift shows there and not from frame to frame.
class RestDetector {
 public:
  void clear();
  /// `mean_rate_rad_s`: mean |w - b_g| since the last frame. True while nothing moved for about half a second.
  bool update(const TrackedFrame& frame, double pixel_sigma, double mean_rate_rad_s);
  /// Only the camera's part of the last verdict.
  bool images_still() const { return images_still_; }

 private:
  struct Entry {
    std::uint32_t id;
    Vec3 f_C;
  };
  struct Snapshot {
    HostStamp stamp;
    int count = 0;
    std::array<Entry, kMaxFeatures> entry;  ///< sorted by id
  };
  bool still_against(const Snapshot& old, const TrackedFrame& frame, double sigma) const;
  void remember(const TrackedFrame& frame);

  static constexpr int kSnapshots = 8;
  std::array<Snapshot, kSnapshots> snapshot_;
  int stored_ = 0, next_ = 0;
  bool images_still_ = false;
};

}  // namespace epiline
