#include "estimator/monitor/turn_between.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kFarBearing = 0.003;  // rad: residuals of bearings beyond count less
constexpr int kFarRounds = 5, kSteps = 10;
constexpr double kLittle = 0.01;  // of the cost: a step that gains less is the last; the next would be a tenth of it
constexpr int kTried = 4;         // of six directions: for 332 pairs that fitted badly, the other two were best once
constexpr int kPlaneRounds = 4;
constexpr double kPlaneCost = 1.5, kPlaneCostLeast = 0.05;  // a plane must explain the bearings nearly as well
constexpr float kLeastMoved = 1e-3F;                        // sine: a bearing along the travel shows no parallax
constexpr double kOneSide = 0.95;                           // of the bearings, some of which are false
constexpr double kGoodCost = 0.35;  // log(1 + e^2) of a mean angle of 0.65 mrad: other directions would not do better

using Row = SharedBearings::Row;
using Vectors = SharedBearings::Vectors;
constexpr auto kScale_rad = static_cast<float>(kCostScale_rad);

Row dot(const Vectors& a, const Vectors& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Row dot(const Vec3& a_double, const Vectors& b) {
  const Eigen::Vector3f a = a_double.cast<float>();
  return a.x() * b.x + a.y() * b.y + a.z() * b.z;
}
Vectors cross(const Vectors& a, const Vectors& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Vectors cross(const Vec3& a_double, const Vectors& b) {
  const Eigen::Vector3f a = a_double.cast<float>();
  return {a.y() * b.z - a.z() * b.y, a.z() * b.x - a.x() * b.z, a.x() * b.y - a.y() * b.x};
}
Vectors operator*(const Mat3& R_double, const Vectors& b) {
  const Eigen::Matrix3f R = R_double.cast<float>();
  return {R(0, 0) * b.x + R(0, 1) * b.y + R(0, 2) * b.z, R(1, 0) * b.x + R(1, 1) * b.y + R(1, 2) * b.z,
          R(2, 0) * b.x + R(2, 1) * b.y + R(2, 2) * b.z};
}

/// As if everything were far away.
Mat3 turn_of_far_points(const SharedBearings& s) {
  Mat3 R_CC0 = Mat3::Identity();
  std::array<double, SharedBearings::kMost> weights;
  weights.fill(1);
  for (int round = 0; round < kFarRounds; ++round) {
    Mat3 sum = Mat3::Zero();
    for (int i = 0; i < s.count; ++i)
      sum += weights[static_cast<std::size_t>(i)] * s.now.at(i) * s.before.at(i).transpose();
    R_CC0 = rotation_from(sum);
    for (int i = 0; i < s.count; ++i) {
      const double off2 = (s.now.at(i) - R_CC0 * s.before.at(i)).squaredNorm() / (kFarBearing * kFarBearing);
      weights[static_cast<std::size_t>(i)] = 1 / (1 + off2);
    }
  }
  return R_CC0;
}

/// Mean of log(1 + (e/kScale_rad)^2) over `count` bearings. One logarithm for four: an angle is at most 1 rad, so their
/// product is below 1e25.
double mean_cost(int count, const Row& e) {
  constexpr int kQuarter = SharedBearings::kMost / 4;
  const Row factors = 1 + (e / kScale_rad).square();
  const Eigen::Array<float, 1, kQuarter> product = factors.segment<kQuarter>(0) * factors.segment<kQuarter>(kQuarter) *
                                                   factors.segment<kQuarter>(2 * kQuarter) *
                                                   factors.segment<kQuarter>(3 * kQuarter);
  return static_cast<double>(product.log().sum()) / count;
}

/// Turn and direction of travel, improved together: Gauss-Newton on the angles to epipolar planes.
class Travel {
 public:
  Travel(const SharedBearings& s, const Mat3& R_CC0, const Vec3& direction) : s_(s) {
    at(R_CC0, direction, motions_[0]);
  }
  double cost() const { return now().cost; }
  CameraTurn improved() {
    for (int i = 0; i < kSteps && step(); ++i) {
    }
    return {now().R, now().t, now().cost};
  }

 private:
  static constexpr int kUnknowns = 5;
  using Vec5 = Eigen::Matrix<double, kUnknowns, 1>;
  using Mat5 = Eigen::Matrix<double, kUnknowns, kUnknowns>;

  /// A motion and what it leaves.
  struct Motion {
    Mat3 R;
    Vec3 t;
    double cost;
    Vectors g;     ///< the bearings before, turned
    Row scale, e;  ///< e: angle from g to the plane of the bearing now and the direction
  };

  const Motion& now() const { return motions_[static_cast<std::size_t>(now_)]; }
  void at(const Mat3& R, const Vec3& t, Motion& m) const {
    m.R = R;
    m.t = t;
    m.g = R * s_.before;
    const Vectors across = cross(t, s_.now);
    m.scale = dot(across, across).sqrt().max(0.1F).inverse();
    m.e = -m.scale * dot(across, m.g);
    m.cost = mean_cost(s_.count, m.e);
  }
  bool step() {
    const Motion& m = now();
    const Vec3& t = m.t;
    const Vec3 other = std::abs(t.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
    Eigen::Matrix<double, 3, 2> across;  // of the direction
    across.col(0) = t.cross(other).normalized();
    across.col(1) = t.cross(across.col(0));
    // de = scale ((t.g) f - (g.f) t).dphi + scale (g x f).dt
    const Vectors& f = s_.now;
    const Row tg = m.scale * dot(t, m.g), gf = m.scale * dot(m.g, f);
    const Eigen::Vector3f tf = t.cast<float>();
    const Vectors by_t = cross(m.g, f);
    const std::array<Row, kUnknowns> J{tg * f.x - tf.x() * gf, tg * f.y - tf.y() * gf, tg * f.z - tf.z() * gf,
                                       m.scale * dot(across.col(0), by_t), m.scale * dot(across.col(1), by_t)};
    const Row weight = (1 + (m.e / kScale_rad).square()).inverse();
    Mat5 H = Mat5::Zero();  // its lower triangle
    Vec5 b;
    for (int row = 0; row < kUnknowns; ++row) {
      const Row weighted = weight * J[static_cast<std::size_t>(row)];
      for (int column = 0; column <= row; ++column)
        H(row, column) = static_cast<double>((weighted * J[static_cast<std::size_t>(column)]).sum());
      b[row] = -static_cast<double>((weighted * m.e).sum());
      H(row, row) += 1e-6 * s_.count;  // a direction nobody sees stays
    }
    const Vec5 d = H.selfadjointView<Eigen::Lower>().llt().solve(b);
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
  out = Travel(bearings, R_CC0, hint).improved();
  const double good = std::max(kGoodCost, usual_cost);
  if (out.cost < good) return true;
  const Mat3 far = turn_of_far_points(bearings);
  std::array<Travel, 6> travels{Travel(bearings, far, hint),
                                Travel(bearings, far, Vec3(1, 0, 0)),
                                Travel(bearings, far, Vec3(0, 1, 0)),
                                Travel(bearings, far, Vec3(0, 0, 1)),
                                Travel(bearings, far, Vec3(1, 1, 1).normalized()),
                                Travel(bearings, far, Vec3(1, -1, 1).normalized())};
  std::array<Travel*, travels.size()> order;
  std::transform(travels.begin(), travels.end(), order.begin(), [](Travel& t) { return &t; });
  std::partial_sort(order.begin(), order.begin() + kTried, order.end(),
                    [](const Travel* a, const Travel* b) { return a->cost() < b->cost(); });
  for (int i = 0; i < kTried && !(out.cost < good); ++i) {
    const CameraTurn turn = order[static_cast<std::size_t>(i)]->improved();
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
  const Vectors along = cross(turn.direction, s.now);
  // sine by which a point at distance 1 moves, and by which this one did
  const Row moved = dot(along, along).sqrt();
  const Row seen = dot(cross(s.now, turn.R_CC0 * s.before), along) / moved.max(kLeastMoved);
  const Vectors J{moved * s.before.x, moved * s.before.y, moved * s.before.z};
  Vec3 n = Vec3::Zero();
  Row e = seen, weight = Row::Ones();
  for (int round = 0; round < kPlaneRounds; ++round) {
    const Vectors weighted{weight * J.x, weight * J.y, weight * J.z};
    Eigen::Matrix3f H = kLeastMoved * kLeastMoved * Eigen::Matrix3f::Identity();
    H(0, 0) += (weighted.x * J.x).sum();
    H(1, 0) += (weighted.y * J.x).sum();
    H(1, 1) += (weighted.y * J.y).sum();
    H(2, 0) += (weighted.z * J.x).sum();
    H(2, 1) += (weighted.z * J.y).sum();
    H(2, 2) += (weighted.z * J.z).sum();
    const Eigen::Vector3f b((weighted.x * seen).sum(), (weighted.y * seen).sum(), (weighted.z * seen).sum());
    n = H.cast<double>().selfadjointView<Eigen::Lower>().ldlt().solve(b.cast<double>());
    e = seen - dot(n, J);
    weight = (1 + (e / kScale_rad).square()).inverse();
  }
  return {n, mean_cost(s.count, e)};
}

/// All points on one side of the camera. The direction's sign is arbitrary, so the side is, too.
bool is_on_one_side(const SharedBearings& s, const Vec3& n) {
  const auto in_front = static_cast<int>((dot(n, s.before) > 0).count());
  return kOneSide * s.count <= std::max(in_front, s.count - in_front);
}

}  // namespace

double settle_plane(const SharedBearings& s, double least, CameraTurn& turn) noexcept {
  const Plane plane = plane_of(s, turn);
  if (!(plane.cost < kPlaneCost * turn.cost + kPlaneCostLeast)) return 0;
  const Vec3 n = turn.R_CC0 * plane.n, across = turn.direction.cross(n);
  const double apart = across.norm();
  if (apart < least) return apart;
  const CameraTurn other = Travel(s, so3_exp(across) * turn.R_CC0, n.normalized()).improved();
  const bool here = is_on_one_side(s, plane.n), there = is_on_one_side(s, plane_of(s, other).n);
  if (here == there) return apart;
  if (there) turn = other;
  return 0;
}

}  // namespace epiline
