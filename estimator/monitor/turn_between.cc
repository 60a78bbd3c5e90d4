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
constexpr int kPlaneRounds = 4;
constexpr double kPlaneCost = 1.5, kPlaneCostLeast = 0.05;  // a plane must explain the bearings nearly as well
constexpr double kLeastMoved = 1e-3;                        // sine: a bearing along the travel shows no parallax
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

/// Turn and direction of travel, improved together: Gauss-Newton on the angles to epipolar planes.
class Travel {
 public:
  Travel(const SharedBearings& s, const Mat3& R_CC0, const Vec3& direction) : s_(s), R_(R_CC0), t_(direction) {
    cost_ = cost(R_, t_);
    for (int i = 0; i < kSteps && step(); ++i) {
    }
  }
  CameraTurn result() const { return {R_, t_, cost_ / s_.count}; }

 private:
  using Vec5 = Eigen::Matrix<double, 5, 1>;
  using Mat5 = Eigen::Matrix<double, 5, 5>;

  /// From the bearing before, turned, to the plane of the bearing now and the direction.
  static double angle(const Vec3& turned, const Vec3& now, const Vec3& t, double& scale) {
    scale = 1 / std::max(t.cross(now).norm(), 0.1);
    return scale * t.dot(turned.cross(now));
  }
  /// Sum of log(1 + off^2). One logarithm for many bearings: an angle is at most 1 rad, so the product of kFactors is
  /// below 1e193.
  double cost(const Mat3& R, const Vec3& t) const {
    constexpr int kFactors = 32;
    double sum = 0, scale = 0;
    for (int first = 0; first < s_.count; first += kFactors) {
      double product = 1;
      for (int i = first; i < std::min(first + kFactors, s_.count); ++i) {
        const double off = angle(R * s_.before[i], s_.now[i], t, scale) / kCostScale_rad;
        product *= 1 + off * off;
      }
      sum += std::log(product);
    }
    return sum;
  }
  bool step() {
    const Vec3 other = std::abs(t_.x()) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
    Eigen::Matrix<double, 3, 2> across;  // of the direction
    across.col(0) = t_.cross(other).normalized();
    across.col(1) = t_.cross(across.col(0));
    Mat5 H = Mat5::Zero();
    Vec5 b = Vec5::Zero();
    for (int i = 0; i < s_.count; ++i) {
      const Vec3 g = R_ * s_.before[i];
      const Vec3& f = s_.now[i];
      double scale = 0;
      const double e = angle(g, f, t_, scale);
      Vec5 J;
      J.head<3>() = scale * (t_.dot(g) * f - g.dot(f) * t_);
      J.tail<2>() = scale * (across.transpose() * g.cross(f));
      const double weight = 1 / (1 + e * e / (kCostScale_rad * kCostScale_rad));
      H.noalias() += weight * J * J.transpose();
      b -= weight * e * J;
    }
    H.diagonal().array() += 1e-6 * s_.count;  // a direction nobody sees stays
    const Vec5 d = H.selfadjointView<Eigen::Lower>().ldlt().solve(b);
    const Mat3 R = so3_exp(d.head<3>()) * R_;
    const Vec3 t = (t_ + across * d.tail<2>()).normalized();
    const double next = cost(R, t);
    if (!(next < cost_)) return false;
    const bool goes_on = cost_ - next > 1e-3 * cost_;
    R_ = R;
    t_ = t;
    cost_ = next;
    return goes_on;
  }

  const SharedBearings& s_;
  Mat3 R_;
  Vec3 t_;
  double cost_ = 0;
};

CameraTurn best_travel(const SharedBearings& bearings, const Mat3& R_CC0, const Vec3& hint) {
  CameraTurn out = Travel(bearings, R_CC0, hint).result();
  if (out.cost < kGoodCost) return out;
  const Mat3 far = turn_of_far_points(bearings);
  for (const Vec3& direction : {hint, Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 1).normalized().eval(),
                                Vec3(1, -1, 1).normalized().eval()}) {
    if (out.cost < kGoodCost) break;
    const CameraTurn turn = Travel(bearings, far, direction).result();
    if (turn.cost < out.cost) out = turn;
  }
  return out;
}

/// Of points in a plane, n'X = 1 in the camera before, the images are a homography R + t n'. R + n t' explains them as
/// well after a turn by t x n more, which are two rotations to choose from. |t| is 1 here, so n in units of the travel.
double ambiguity_of(const SharedBearings& s, const CameraTurn& turn) {
  std::array<double, SharedBearings::kMost> weights;
  weights.fill(1);
  Vec3 n = Vec3::Zero();
  double off_plane = 0;
  for (int round = 0; round < kPlaneRounds; ++round) {
    Mat3 H = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    off_plane = 0;
    for (int i = 0; i < s.count; ++i) {
      // along the epipolar line, f_now x (R f + t (n'f)) = 0 is linear in n
      const Vec3 turned = turn.R_CC0 * s.before[i], along = turn.direction.cross(s.now[i]);
      const double moved = along.norm(), seen = s.now[i].cross(turned).dot(along) / std::max(moved, kLeastMoved);
      const double e = (seen - moved * n.dot(s.before[i])) / kCostScale_rad;
      off_plane += std::log1p(e * e);
      if (round > 0) weights[i] = 1 / (1 + e * e);
      H += weights[i] * moved * moved * s.before[i] * s.before[i].transpose();
      b += weights[i] * moved * seen * s.before[i];
    }
    H.diagonal().array() += kLeastMoved * kLeastMoved;
    n = H.ldlt().solve(b);
  }
  const bool is_plane = off_plane / s.count < kPlaneCost * turn.cost + kPlaneCostLeast;
  return is_plane ? (turn.R_CC0.transpose() * turn.direction).cross(n).norm() : 0;
}

}  // namespace

Mat3 rotation_from(const Mat3& sum) noexcept {
  const Eigen::JacobiSVD<Mat3> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vec3(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

bool turn_between(const SharedBearings& bearings, const Mat3& R_CC0, const Vec3& hint, CameraTurn& out) noexcept {
  if (bearings.count < SharedBearings::kFewest) return false;
  out = best_travel(bearings, R_CC0, hint);
  out.ambiguity = ambiguity_of(bearings, out);
  return true;
}

}  // namespace epiline
