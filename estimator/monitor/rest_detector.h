#pragma once
// Detects standstill from camera and gyroscope together. Derivation: docs/derivations/zero_motion.md.
#include <array>
#include <cstdint>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Compares each frame's bearings with a copy half a second old and, during standstill, with those of its beginning,
/// which reveal a drift too slow for half a second. After such a drift, standstill must last twice as long as the drift
/// was overlooked before it is reported, until a clear motion is seen.
class RestDetector {
 public:
  void clear();
  /// `mean_rate_rad_s`: mean |w - b_g| since the last frame. True while nothing moved for long enough.
  bool update(const TrackedFrame& frame, double pixel_sigma, double mean_rate_rad_s);
  /// True if the last frame shows that the reported standstill was a slow drift.
  bool was_drift() const { return was_drift_; }
  /// The camera's part of the last verdict alone, over half a second.
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
  struct Displacement;
  static Displacement displacement(const Snapshot& old, const TrackedFrame& frame, double sigma);
  const Snapshot* half_a_second_old(HostStamp now) const;
  void compare_with_reference(const TrackedFrame& frame, double sigma);
  void remember(const TrackedFrame& frame);

  static constexpr int kSnapshots = 8;
  std::array<Snapshot, kSnapshots> snapshot_;
  Snapshot reference_;  ///< at the beginning of the standstill
  int stored_ = 0, next_ = 0;
  bool has_reference_ = false, is_rest_ = false, images_still_ = false, was_drift_ = false;
  double needed_s_ = 0;  ///< required duration of standstill
};

}  // namespace epiline
