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
constexpr double kOneSide = 0.95;                           // of the bearings, some of which are false
constexpr double kGoodCost = 0.35;  // log(1 + e^2) of a mean angle of 0.65 mrad: other directions would not do better

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

/// Symmetric, from the lower triangle, row by row.
template <int n>
Eigen::Matrix<double, n, n> symmetric(const double* lower) {
  Eigen::Matrix<double, n, n> H;
  for (int row = 0, at = 0; row < n; ++row)
    for (int column = 0; column <= row; ++column, ++at) H(row, column) = H(column, row) = lower[at];
  return H;
}

/// Turn and direction of travel, improved together: Gauss-Newton on the angles to epipolar planes.
class Travel {
 public:
  Travel(const SharedBearings& s, const Mat3& R_CC0, const Vec3& direction, const TurnKernels& kernels)
      : s_(s), kernels_(kernels) {
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

  /// A motion and what it leaves.
  struct Motion {
    Mat3 R;
    Vec3 t;
    double cost;
    EpipolarAngles angles;
  };

  const Motion& now() const { return motions_[static_cast<std::size_t>(now_)]; }
  void at(const Mat3& R, const Vec3& t, Motion& m) const {
    m.R = R;
    m.t = t;
    const RowMat3 rows = R;
    m.cost = kernels_.look(s_.before, s_.now, rows.data(), t.data(), m.angles) / s_.count;
  }
  bool step() {
    const Motion& m = now();
    const Vec3& t = m.t;
    const Vec3 other = std::abs(t.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
    Eigen::Matrix<double, 3, 2> across;  // of the direction
    across.col(0) = t.cross(other).normalized();
    across.col(1) = t.cross(across.col(0));
    double H[kUnknowns * (kUnknowns + 1) / 2];
    Eigen::Matrix<double, kUnknowns, 1> b;
    kernels_.equations(s_.now, m.angles, t.data(), across.data(), H, b.data());
    Eigen::Matrix<double, kUnknowns, kUnknowns> information = symmetric<kUnknowns>(H);
    information.diagonal().array() += 1e-6 * s_.count;  // a direction nobody sees stays
    const Eigen::Matrix<double, kUnknowns, 1> d = information.llt().solve(b);
    Motion& next = motions_[static_cast<std::size_t>(1 - now_)];
    at(so3_exp(d.head<3>()) * m.R, (t + across * d.tail<2>()).normalized(), next);
    if (!(next.cost < m.cost)) return false;
    const bool goes_on = m.cost - next.cost > kLittle * m.cost;
    now_ = 1 - now_;
    return goes_on;
  }

  const SharedBearings& s_;
  const TurnKernels& kernels_;
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
                  const TurnKernels& kernels, CameraTurn& out) noexcept {
  if (bearings.count < SharedBearings::kFewest) return false;
  out = Travel(bearings, R_CC0, hint, kernels).improved();
  const double good = std::max(kGoodCost, usual_cost);
  if (out.cost < good) return true;
  const Mat3 far = turn_of_far_points(bearings);
  const auto from = [&](const Vec3& direction) { return Travel(bearings, far, direction, kernels); };
  std::array<Travel, 6> travels{from(hint),
                                from(Vec3(1, 0, 0)),
                                from(Vec3(0, 1, 0)),
                                from(Vec3(0, 0, 1)),
                                from(Vec3(1, 1, 1).normalized()),
                                from(Vec3(1, -1, 1).normalized())};
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

/// Robustly fitted to the parallaxes.
Plane plane_of(const SharedBearings& s, const CameraTurn& turn, const TurnKernels& kernels) {
  const RowMat3 R = turn.R_CC0;
  Parallaxes rows;
  kernels.parallaxes(s.before, s.now, R.data(), turn.direction.data(), rows);
  double H[6];
  Vec3 n, b;
  kernels.plane(rows, nullptr, H, b.data());
  double cost = 0;
  for (int round = 0; round < kPlaneRounds; ++round) {
    Mat3 information = symmetric<3>(H);
    information.diagonal().array() += static_cast<double>(kLeastMoved * kLeastMoved);
    n = information.ldlt().solve(b);
    cost = kernels.plane(rows, n.data(), H, b.data());
  }
  return {n, cost / s.count};
}

/// All points on one side of the camera. The direction's sign is arbitrary, so the side is, too.
bool is_on_one_side(const SharedBearings& s, const Vec3& n) {
  int in_front = 0;
  for (int i = 0; i < s.count; ++i) in_front += n.dot(s.before.at(i)) > 0;
  return kOneSide * s.count <= std::max(in_front, s.count - in_front);
}

}  // namespace

double settle_plane(const SharedBearings& s, double least, const TurnKernels& kernels, CameraTurn& turn) noexcept {
  const Plane plane = plane_of(s, turn, kernels);
  if (!(plane.cost < kPlaneCost * turn.cost + kPlaneCostLeast)) return 0;
  const Vec3 n = turn.R_CC0 * plane.n, across = turn.direction.cross(n);
  const double apart = across.norm();
  if (apart < least) return apart;
  const CameraTurn other = Travel(s, so3_exp(across) * turn.R_CC0, n.normalized(), kernels).improved();
  const bool here = is_on_one_side(s, plane.n), there = is_on_one_side(s, plane_of(s, other, kernels).n);
  if (here == there) return apart;
  if (there) turn = other;
  return 0;
}

}  // namespace epiline
