#include "pipeline/vision/two_point.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/geometry/types.h"

namespace epiline {
namespace {

using Direction = Eigen::Vector3f;

Direction before_of(const BearingPairs& p, int i) { return {p.before_x[i], p.before_y[i], p.before_z[i]}; }
Direction now_of(const BearingPairs& p, int i) { return {p.now_x[i], p.now_y[i], p.now_z[i]}; }

// Normal of the epipolar plane of pair i; its length is the sine of the parallax.
Direction plane_normal(const BearingPairs& p, int i) { return before_of(p, i).cross(now_of(p, i)); }

// Direction of travel through the epipolar planes of two pairs. False: they are the same plane, or there is no
// parallax.
bool direction_from(const BearingPairs& pairs, int i, int j, Direction& t) {
  constexpr float kTooSmall = 1e-9f;
  t = plane_normal(pairs, i).cross(plane_normal(pairs, j));
  const float length = std::sqrt(t.x() * t.x() + t.y() * t.y() + t.z() * t.z());
  if (!(length > kTooSmall)) return false;
  t /= length;
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

using Distances = float[BearingPairs::kCapacity];

// Best direction of all hypotheses; its truncated cost, or the largest float if none is defined.
float best_direction(const BearingPairs& pairs, int hypotheses, float limit2, Distances& distance2, Direction& best) {
  Lottery lottery(pairs.size);
  float least = std::numeric_limits<float>::max();
  for (int k = 0; k < hypotheses; ++k) {
    const int i = lottery.draw(), j = lottery.draw();
    Direction t;
    if (!direction_from(pairs, i, j, t)) continue;
    const float cost = direction_cost(pairs, t.data(), limit2, distance2);
    if (cost < least) {
      least = cost;
      best = t;
    }
  }
  return least;
}

int mark(const Distances& distance2, int size, float limit2, std::array<bool, BearingPairs::kCapacity>& inlier) {
  int outliers = 0;
  for (int i = 0; i < size; ++i) {
    inlier[i] = distance2[i] <= limit2;
    outliers += !inlier[i];
  }
  return outliers;
}

struct Motion {
  Mat3 R = Mat3::Identity();  // correction, applied to the bearings before
  Vec3 t;
};

// One Gauss-Newton step of rotation and direction with Cauchy weights of the given scale. e = now . (t x R before), so
// de/dR = (R before) x (now x t) and de/dt = (R before) x now; the Sampson weight is held.
void improve(const BearingPairs& pairs, double scale_rad, Motion& motion) {
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  Eigen::Matrix<double, 5, 5> H = Eigen::Matrix<double, 5, 5>::Identity() * 1e-9;
  Vec5 g = Vec5::Zero();
  const Vec3 u = motion.t.unitOrthogonal(), w = motion.t.cross(u);
  for (int i = 0; i < pairs.size; ++i) {
    const Vec3 a = motion.R * before_of(pairs, i).cast<double>(), b = now_of(pairs, i).cast<double>();
    const Vec3 ta = motion.t.cross(a), bt = b.cross(motion.t), ab = a.cross(b);
    const double e = b.dot(ta);
    const double norm2 = std::max(ta.squaredNorm() + bt.squaredNorm() - 2 * e * e, 1e-12);
    const double weight = 1 / (norm2 * (1 + e * e / (norm2 * scale_rad * scale_rad)));
    Vec5 J;
    J << a.cross(bt), ab.dot(u), ab.dot(w);
    H += weight * J * J.transpose();
    g += weight * e * J;
  }
  const Vec5 d = -H.ldlt().solve(g);
  const Vec3 turn = d.head<3>();
  if (!d.allFinite() || turn.norm() > 0.2) return;  // no small correction
  motion.R = Eigen::Quaterniond(1, 0.5 * turn.x(), 0.5 * turn.y(), 0.5 * turn.z()).normalized() * motion.R;
  motion.t = (motion.t + d[3] * u + d[4] * w).normalized();
}

void rotate_before(const Mat3& R, BearingPairs& pairs) {
  for (int i = 0; i < pairs.size; ++i) {
    const Vec3 f = R * before_of(pairs, i).cast<double>();
    pairs.before_x[i] = static_cast<float>(f.x());
    pairs.before_y[i] = static_cast<float>(f.y());
    pairs.before_z[i] = static_cast<float>(f.z());
  }
}

// Fits rotation and direction to all pairs, from a scale that forgives large errors of rotation down to the limit.
void correct_rotation(float limit_rad, BearingPairs& pairs, Direction& direction) {
  Motion motion{Mat3::Identity(), direction.cast<double>()};
  for (double factor : {8.0, 8.0, 4.0, 2.0, 1.0, 1.0}) improve(pairs, factor * limit_rad, motion);
  rotate_before(motion.R, pairs);
  direction = motion.t.cast<float>();
}

}  // namespace

void find_inliers(BearingPairs& pairs, const TwoPointSettings& settings,
                  std::array<bool, BearingPairs::kCapacity>& inlier) noexcept {
  inlier.fill(true);
  if (pairs.size < kFewestPairs) return;
  alignas(64) Distances distance2;
  const float limit2 = settings.limit_rad * settings.limit_rad;
  Direction best = Direction::Zero();
  const float least = best_direction(pairs, settings.hypotheses, limit2, distance2, best);
  if (least == std::numeric_limits<float>::max()) return;
  direction_cost(pairs, best.data(), limit2, distance2);
  const int outliers = mark(distance2, pairs.size, limit2, inlier);
  if (static_cast<float>(outliers) <= settings.doubt_share * static_cast<float>(pairs.size)) return;
  correct_rotation(settings.limit_rad, pairs, best);
  if (direction_cost(pairs, best.data(), limit2, distance2) < least) mark(distance2, pairs.size, limit2, inlier);
}

}  // namespace epiline
