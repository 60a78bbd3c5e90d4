#pragma once
// How well a direction of travel explains pairs of bearings whose rotation has been taken out.
#include <cstddef>

#include "platform/samples/samples.h"

namespace epiline {

/// Unit bearings before (rotated into the current camera frame) and now; structure of arrays. `size` pairs are used;
/// the capacity has room for a whole last vector, whose unused lanes must be finite.
struct BearingPairs {
  static constexpr std::size_t kCapacity = (kMaxFeatures + 31) / 16 * 16;
  alignas(64) float before_x[kCapacity] = {};
  alignas(64) float before_y[kCapacity] = {};
  alignas(64) float before_z[kCapacity] = {};
  alignas(64) float now_x[kCapacity] = {};
  alignas(64) float now_y[kCapacity] = {};
  alignas(64) float now_z[kCapacity] = {};
  int size = 0;
};

/// Writes every pair's squared Sampson distance on the sphere (rad^2) under the direction (tx, ty, tz), of unit length,
/// to `distance2` (kCapacity), and returns their sum with each cut off at `limit2`.
float direction_cost(const BearingPairs& pairs, const float direction[3], float limit2, float* distance2) noexcept;

}  // namespace epiline
