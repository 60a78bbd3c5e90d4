#include "estimator/monitor/turn_between.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kFarBearing = 0.003;  // rad: residuals of bearings beyond count less
constexpr int kFarRounds = 5, kSteps = 10;
constexpr double kLittle = 0.01;  // of the cost: a step that gains less is the last; the next would be a tenth of it
constexpr int kPlaneRounds = 4;
constexpr double kPlaneCost = 1.5, kPlaneCostLeast = 0.05;  // a plane must explain the bearings nearly as well
constexpr double kLeastMoved = 1e-3;                        // sine: a bearing along the travel shows no parallax
constexpr double kOneSide = 0.95;                           // of the bearings, some of which are false
constexpr double kGoodCost = 0.35;  // log(1 + e^2) of a mean angle of 0.65 mrad: other directions would not do better

/// As if everything were far away.
Mat3 turn_of_far_points(const SharedBearings& s) {
  Mat3 R_CC0 = Mat3::Identity();
  std::array<double, SharedBearings::kMost> weights;
  weights.fill(1);
  for (int round = 0; round < kFarRounds; ++round) {
    Mat3 sum = Mat3::Zero();
    for (int i = 0; i < s.count; ++i) sum += weights[i] * s.now[i] * s.before[i].transpose();
    R_CC0 = rotation_from(sum);
    for (int i = 0; i < s.count; ++i) {
      const double off2 = (s.now[i] - R_CC0 * s.before[i]).squaredNorm() / (kFarBearing * kFarBearing);
      weights[i] = 1 / (1 + off2);
    }
  }
  return R_CC0;
}

/// Mean of log(1 + off^2) over `count` bearings. One logarithm for many: an angle is at most 1 rad, so the product of
/// kFactors is below 1e193.
template <class Off>
double mean_cost(int count, Off&& off) {
  constexpr int kFactors = 32;
  double sum = 0;
  for (int first = 0; first < count; first += kFactors) {
    double product = 1;
    for (int i = first; i < std::min(first + kFactors, count); ++i) {
      const double e = off(i);
      product *= 1 + e * e;
    }
    sum += std::log(product);
  }
  return sum / count;
}

/// Turn and direction of travel, improved together: Gauss-Newton on the angles to epipolar planes.
class Travel {
 public:
  Travel(const SharedBearings& s, const Mat3& R_CC0, const Vec3& direction) : s_(s) {
    at(R_CC0, direction, motions_[0]);
    for (int i = 0; i < kSteps && step(); ++i) {
    }
  }
  CameraTurn result() const { return {now().R, now().t, now().cost}; }

 private:
  static constexpr int kUnknowns = 5;
  using Vec5 = Eigen::Matrix<double, kUnknowns, 1>;
  using Mat5 = Eigen::Matrix<double, kUnknowns, kUnknowns>;

  /// A motion and what it leaves.
  struct Motion {
    Mat3 R;
    Vec3 t;
    double cost;
    struct Angle {
      Vec3 g;           ///< the bearing before, turned
      double scale, e;  ///< e: angle from g to the plane of the bearing now and the direction
    };
    std::array<Angle, SharedBearings::kMost> angles;
  };

  const Motion& now() const { return motions_[static_cast<std::size_t>(now_)]; }
  void at(const Mat3& R, const Vec3& t, Motion& m) const {
    m.R = R;
    m.t = t;
    m.cost = mean_cost(s_.count, [&](int i) {
      const auto k = static_cast<std::size_t>(i);
      Motion::Angle& angle = m.angles[k];
      angle.g.noalias() = R * s_.before[k];
      const Vec3 across = t.cross(s_.now[k]);
      angle.scale = 1 / std::max(across.norm(), 0.1);
      angle.e = -angle.scale * across.dot(angle.g);
      return angle.e / kCostScale_rad;
    });
  }
  bool step() {
    const Motion& m = now();
    const Vec3& t = m.t;
    const Vec3 other = std::abs(t.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
    Eigen::Matrix<double, 3, 2> across;  // of the direction
    across.col(0) = t.cross(other).normalized();
    across.col(1) = t.cross(across.col(0));
    double H[kUnknowns][kUnknowns] = {}, b[kUnknowns] = {};  // the lower triangle
    for (int i = 0; i < s_.count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto& [g, scale, e] = m.angles[k];
      const Vec3& f = s_.now[k];
      Vec5 J;
      J.head<3>() = scale * (t.dot(g) * f - g.dot(f) * t);
      J.tail<2>() = scale * (across.transpose() * g.cross(f));
      const double weight = 1 / (1 + e * e / (kCostScale_rad * kCostScale_rad));
      for (int row = 0; row < kUnknowns; ++row) {
        const double weighted = weight * J[row];
        for (int column = 0; column <= row; ++column) H[row][column] += weighted * J[column];
        b[row] -= weighted * e;
      }
    }
    for (int i = 0; i < kUnknowns; ++i) H[i][i] += 1e-6 * s_.count;  // a direction nobody sees stays
    const Eigen::Map<const Eigen::Matrix<double, kUnknowns, kUnknowns, Eigen::RowMajor>> lower(H[0]);
    const Vec5 d = Mat5(lower).selfadjointView<Eigen::Lower>().ldlt().solve(Eigen::Map<const Vec5>(b));
    Motion& next = motions_[static_cast<std::size_t>(1 - now_)];
    at(so3_exp(d.head<3>()) * m.R, (t + across * d.tail<2>()).normalized(), next);
    if (!(next.cost < m.cost)) return false;
    const bool goes_on = m.cost - next.cost > kLittle * m.cost;
    now_ = 1 - now_;
    return goes_on;
  }

  const SharedBearings& s_;
  std::array<Motion, 2> motions_;  ///< the best one, and the one that is tried
  int now_ = 0;
};

}  // namespace

Mat3 rotation_from(const Mat3& sum) noexcept {
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vec3(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

bool turn_between(const SharedBearings& bearings, const Mat3& R_CC0, const Vec3& hint, double usual_cost,
                  CameraTurn& out) noexcept {
  if (bearings.count < SharedBearings::kFewest) return false;
  out = Travel(bearings, R_CC0, hint).result();
  const double good = std::max(kGoodCost, usual_cost);
  if (out.cost < good) return true;
  const Mat3 far = turn_of_far_points(bearings);
  for (const Vec3& direction : {hint, Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 1).normalized().eval(),
                                Vec3(1, -1, 1).normalized().eval()}) {
    if (out.cost < good) break;
    const CameraTurn turn = Travel(bearings, far, direction).result();
    if (turn.cost < out.cost) out = turn;
  }
  return true;
}

namespace {

struct Plane {
  Vec3 n = Vec3::Zero();  ///< n'X = 1 in the camera before, with |t| = 1
  double cost = 0;        ///< as CameraTurn::cost, of the parallax
};

// Along the epipolar line f_now x (R f + t (n'f)) = 0 is linear in n, robustly so.
Plane plane_of(const SharedBearings& s, const CameraTurn& turn) {
  struct Parallax {
    double moved, seen;  // sine by which a point at distance 1 moves; by which this one did
  };
  std::array<Parallax, SharedBearings::kMost> parallax;
  for (int i = 0; i < s.count; ++i) {
    const Vec3 along = turn.direction.cross(s.now[i]);
    const double moved = along.norm();
    const double seen = s.now[i].cross(turn.R_CC0 * s.before[i]).dot(along) / std::max(moved, kLeastMoved);
    parallax[static_cast<std::size_t>(i)] = {moved, seen};
  }
  Vec3 n = Vec3::Zero();
  const auto off_plane = [&](int i) {
    const Parallax& p = parallax[static_cast<std::size_t>(i)];
    return (p.seen - p.moved * n.dot(s.before[i])) / kCostScale_rad;
  };
  for (int round = 0; round < kPlaneRounds; ++round) {
    Mat3 H = kLeastMoved * kLeastMoved * Mat3::Identity();
    Vec3 b = Vec3::Zero();
    for (int i = 0; i < s.count; ++i) {
      const Parallax& p = parallax[static_cast<std::size_t>(i)];
      const double e = off_plane(i), weight = round == 0 ? 1 : 1 / (1 + e * e);
      H += weight * p.moved * p.moved * s.before[i] * s.before[i].transpose();
      b += weight * p.moved * p.seen * s.before[i];
    }
    n = H.ldlt().solve(b);
  }
  return {n, mean_cost(s.count, off_plane)};
}

/// All points on one side of the camera. The direction's sign is arbitrary, so the side is, too.
bool is_on_one_side(const SharedBearings& s, const Vec3& n) {
  int in_front = 0;
  for (int i = 0; i < s.count; ++i) in_front += n.dot(s.before[i]) > 0 ? 1 : 0;
  return kOneSide * s.count <= std::max(in_front, s.count - in_front);
}

}  // namespace

double settle_plane(const SharedBearings& s, double least, CameraTurn& turn) noexcept {
  const Plane plane = plane_of(s, turn);
  if (!(plane.cost < kPlaneCost * turn.cost + kPlaneCostLeast)) return 0;
  const Vec3 n = turn.R_CC0 * plane.n, across = turn.direction.cross(n);
  const double apart = across.norm();
  if (apart < least) return apart;
  const CameraTurn other = Travel(s, so3_exp(across) * turn.R_CC0, n.normalized()).result();
  const bool here = is_on_one_side(s, plane.n), there = is_on_one_side(s, plane_of(s, other).n);
  if (here == there) return apart;
  if (there) turn = other;
  return 0;
}

}  // namespace epiline
