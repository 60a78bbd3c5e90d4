#pragma once
// Outliers under a known rotation: two pairs of bearings give the direction of travel, all others vote.
#include <array>

#include "pipeline/vision/direction_cost.h"

namespace epiline {

struct TwoPointSettings {
  int hypotheses = 40;
  int min_pairs = 10;     ///< with fewer all are inliers
  float limit_rad = 0.f;  ///< Sampson distance of an inlier
};

/// Marks the pairs that agree with the direction of travel of least truncated cost. The random choice has a fixed seed:
/// same pairs, same result. All are inliers where no direction is defined (fewer than `min_pairs`, no motion at all).
void find_inliers(const BearingPairs& pairs, const TwoPointSettings& settings,
                  std::array<bool, BearingPairs::kCapacity>& inlier) noexcept;

}  // namespace epiline
