#pragma once
// Finds the tracks of the vehicle's own parts: they stay in the image while the vehicle moves. Derivation:
// docs/derivations/zero_motion.md#tracks-that-stay.
#include <array>
#include <cstdint>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// What is too far away to show the motion stays, too, and is found with them.
class FixedTracks {
 public:
  /// Compares each track with where it was first seen, or has moved to. `moves`: the vehicle does. Bounded work, no
  /// heap. True: a track was found.
  bool update(const TrackedFrame& frame, double pixel_sigma, bool moves) noexcept;
  /// Whether the vehicle carries what this track of the last frame shows.
  bool contains(std::uint32_t id) const noexcept {
    const Track* t = find(tracks_[newest_], id);
    return t != nullptr && t->is_fixed();
  }
  bool empty() const noexcept { return fixed_ == 0; }

 private:
  struct Track {
    std::uint32_t id = 0;
    bool has_moved = false;
    HostStamp since;       ///< it has stayed ...
    Vec3 f_C;              ///< ... here ...
    double against_s = 0;  ///< ... so long while others moved
    bool is_fixed() const;
  };
  struct List {
    int count = 0;
    std::array<Track, kMaxFeatures> track;  ///< sorted by id
  };
  static const Track* find(const List& list, std::uint32_t id) noexcept;

  std::array<List, 2> tracks_;  ///< of the last two frames
  std::size_t newest_ = 0;
  int fixed_ = 0;
  HostStamp last_;
};

}  // namespace epiline
