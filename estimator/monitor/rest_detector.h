#pragma once
// Detects standstill from camera and gyroscope together. Derivation: docs/derivations/zero_motion.md.
#include <array>
#include <cstdint>
#include <limits>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Compares each frame's bearings with a copy half a second old and, during standstill, with those of its beginning,
/// which reveal a drift too slow for half a second. After such a drift, standstill must last twice as long as the drift
/// was overlooked before it is reported, until a clear motion is seen. What stood stands as long as twenty tracks do: a
/// lorry may fill the view. A vehicle that shakes may rock in its place: the turn between the two, as the attitudes
/// have it, is taken out where that fits better.
class RestDetector {
 public:
  void clear();
  enum class Verdict : std::uint8_t {
    kMoves,
    kIsShaken,  ///< it stood, and has not plainly left its place
    kStands,    ///< nothing moved for long enough
  };
  /// The camera's attitude as estimated, and whether the vehicle shakes.
  struct Attitude {
    Mat3 R_WC;
    bool shakes;
  };
  /// `mean_rate_rad_s`: |mean of w - b_g| since the last frame.
  Verdict update(const TrackedFrame& frame, double pixel_sigma, double mean_rate_rad_s, const Attitude& attitude);
  /// The vehicle has stood until the last frame, with the camera in this attitude.
  void assume_rest(const Mat3& R_WC);
  /// Readings say that it has left: only most of the view shows a rest again.
  void leave() { holds_ = false; }
  /// True if the last frame shows that the reported standstill was a slow drift.
  bool was_drift() const { return was_drift_; }
  /// The copy that rest is judged by; the same as long as the vehicle stays in its place.
  HostStamp reference() const { return has_reference_ ? reference_.stamp : HostStamp{}; }
  /// Most of the view was still for half a second.
  bool images_still() const { return images_still_; }
  /// The same of a vehicle that may shake, of which nothing else is known yet.
  bool images_calm() const { return images_calm_; }
  /// Noise of a bearing in the present rest, else in the last one, with room for more, px.
  double pixel_noise() const { return noise_px_; }
  /// During rest: the attitude has not changed since it began.
  bool attitude_held() const { return attitude_held_; }

 private:
  struct Entry {
    std::uint32_t id;
    Vec3 f_C;
  };
  struct Snapshot {
    HostStamp stamp;
    Mat3 R_WC = Mat3::Identity();
    int count = 0;
    std::array<Entry, kMaxFeatures> entry;  ///< sorted by id
  };
  struct Displacement;
  static Displacement displacement(const Snapshot& old, const TrackedFrame& frame, double sigma, const Mat3& R_now_old);
  static Displacement displacement(const Snapshot& old, const TrackedFrame& frame, double sigma,
                                   const Attitude& attitude, bool& turned);
  const Snapshot& newest() const { return snapshot_[static_cast<std::size_t>((next_ + kSnapshots - 1) % kSnapshots)]; }
  const Snapshot* half_a_second_old(HostStamp now) const;
  void compare_with_reference(const TrackedFrame& frame, double sigma, const Attitude& attitude);
  void remember(const TrackedFrame& frame, const Mat3& R_WC);
  void refer_to(const Snapshot& snapshot, HostStamp now);

  static constexpr int kSnapshots = 8;
  std::array<Snapshot, kSnapshots> snapshot_;
  Snapshot reference_;  ///< at the beginning of the standstill
  int stored_ = 0, next_ = 0;
  bool has_reference_ = false, images_still_ = false, images_calm_ = false, was_drift_ = false;
  bool attitude_held_ = false, is_there_ = false;  ///< where the reference was
  bool was_reported_ = false;                      ///< rest with this reference
  bool holds_ = false;                             ///< a rest, which the images have not seen to end
  bool was_shaken_ = false;                        ///< since then: it may have settled in another attitude
  HostStamp there_at_;
  double noise_px_ = std::numeric_limits<double>::max();  ///< see pixel_noise()
  double needed_s_ = 0;                                   ///< required duration of standstill
};

}  // namespace epiline
