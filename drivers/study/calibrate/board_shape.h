#pragma once
// Where a board's corners really are: printers stretch, paper on cardboard bends, tags come out smaller than drawn, and
// detectors have their own idea of a corner. What that is worth: docs/derivations/rig.md#the-board.
#include <cstdint>
#include <map>
#include <vector>

#include "drivers/study/calibrate/corner_views.h"
#include "estimator/geometry/types.h"

namespace epiline {

class BoardShape {
 public:
  BoardShape() = default;
  /// The corners of the drawing that are seen.
  explicit BoardShape(const std::vector<CornerView>& views);

  int corners() const { return static_cast<int>(offsets_.size()); }
  /// The place of a corner in the list of offsets.
  int index(const BoardCorner& corner) const { return index_.at(corner.id); }
  Vec3 place(const BoardCorner& corner) const {
    return scale * corner.p_T + offsets_[static_cast<std::size_t>(index(corner))];
  }
  Vec3& offset(int corner) { return offsets_[static_cast<std::size_t>(corner)]; }
  const Vec3& offset(int corner) const { return offsets_[static_cast<std::size_t>(corner)]; }
  /// How far a corner usually is from where the drawing has it, each coordinate, m: 0.3 % of the board.
  double sigma_m() const { return sigma_m_; }

  double scale = 1;  ///< of the drawing

 private:
  std::map<std::uint32_t, int> index_;
  std::vector<Vec3> offsets_;  ///< in T
  double sigma_m_ = 1e-3;
};

}  // namespace epiline
