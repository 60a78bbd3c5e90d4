#pragma once
// Outliers under a known rotation: two pairs of bearings give the direction of travel, all others vote. If many
// disagree, the rotation is doubted as well (a gyroscope's bias is unknown at the start).
#include <array>

#include "pipeline/vision/direction_cost.h"

namespace epiline {

/// With fewer pairs all are inliers: two of them fit any direction of travel, and too few vote.
inline constexpr int kFewestPairs = 10;

struct TwoPointSettings {
  int hypotheses = 40;
  float limit_rad = 0.f;      ///< Sampson distance of an inlier
  float doubt_share = 0.03f;  ///< more outliers than this: fit the rotation too
};

/// Marks the pairs that agree with the motion of least truncated cost. The random choice has a fixed seed: same pairs,
/// same result. All are inliers where no direction is defined (fewer than kFewestPairs, no motion at all). The bearings
/// before are rotated in place if the rotation was corrected.
void find_inliers(BearingPairs& pairs, const TwoPointSettings& settings,
                  std::array<bool, BearingPairs::kCapacity>& inlier) noexcept;

}  // namespace epiline
