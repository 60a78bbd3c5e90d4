#include "pipeline/vision/two_point.h"

#include <cmath>
#include <cstdint>
#include <limits>

namespace epiline {
namespace {

struct Direction {
  float v[3] = {0, 0, 0};
};

Direction cross(const Direction& a, const Direction& b) {
  return {{a.v[1] * b.v[2] - a.v[2] * b.v[1], a.v[2] * b.v[0] - a.v[0] * b.v[2], a.v[0] * b.v[1] - a.v[1] * b.v[0]}};
}

// Normal of the epipolar plane of pair i; its length is the sine of the parallax.
Direction plane_normal(const BearingPairs& p, int i) {
  return cross({{p.before_x[i], p.before_y[i], p.before_z[i]}}, {{p.now_x[i], p.now_y[i], p.now_z[i]}});
}

// Direction of travel through the epipolar planes of two pairs. False: they are the same plane, or there is no
// parallax.
bool direction_from(const BearingPairs& pairs, int i, int j, Direction& t) {
  constexpr float kTooSmall = 1e-9f;
  t = cross(plane_normal(pairs, i), plane_normal(pairs, j));
  const float length = std::sqrt(t.v[0] * t.v[0] + t.v[1] * t.v[1] + t.v[2] * t.v[2]);
  if (!(length > kTooSmall)) return false;
  for (float& v : t.v) v /= length;
  return true;
}

class Lottery {
 public:
  explicit Lottery(int size) : size_(static_cast<std::uint32_t>(size)) {}
  int draw() {
    state_ = state_ * 1664525u + 1013904223u;
    return static_cast<int>((state_ >> 8) % size_);
  }

 private:
  std::uint32_t size_;
  std::uint32_t state_ = 12345;
};

}  // namespace

void find_inliers(const BearingPairs& pairs, const TwoPointSettings& settings,
                  std::array<bool, BearingPairs::kCapacity>& inlier) noexcept {
  inlier.fill(true);
  if (pairs.size < settings.min_pairs) return;
  alignas(64) float distance2[BearingPairs::kCapacity];
  const float limit2 = settings.limit_rad * settings.limit_rad;
  Lottery lottery(pairs.size);
  Direction best;
  float least = std::numeric_limits<float>::max();
  for (int k = 0; k < settings.hypotheses; ++k) {
    const int i = lottery.draw(), j = lottery.draw();
    Direction t;
    if (!direction_from(pairs, i, j, t)) continue;
    const float cost = direction_cost(pairs, t.v, limit2, distance2);
    if (cost < least) {
      least = cost;
      best = t;
    }
  }
  if (least == std::numeric_limits<float>::max()) return;
  direction_cost(pairs, best.v, limit2, distance2);
  for (int i = 0; i < pairs.size; ++i) inlier[i] = distance2[i] <= limit2;
}

}  // namespace epiline
