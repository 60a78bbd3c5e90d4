#include "estimator/factors/zero_motion.h"

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {
using Mat6 = Eigen::Matrix<double, 6, 6>;
constexpr double information(double sigma) { return 1 / (sigma * sigma); }

double add_velocity(const Window& w, int k, NormalEquations* out) {
  const Vec3& v = w.at(k).x.v;
  const double known = information(w.at(k).shaken ? kShakenVelocitySigma : kRestVelocitySigma);
  if (out) {
    out->add(velocity_biases_of(k), Vec3(-known * v));
    out->add(velocity_biases_of(k), velocity_biases_of(k), Mat3(known * Mat3::Identity()));
  }
  return known * v.squaredNorm();
}

/// Frame k has the pose of frame l.
double add_link(const Window& w, int k, int l, NormalEquations* out) {
  const NavState &x_k = w.at(k).x, &x_l = w.at(l).x;
  Vec6 r;
  r << x_k.p - x_l.p, so3_log(x_l.R.transpose() * x_k.R);
  Vec6 known;
  known << Vec3::Constant(information(w.at(k).shaken ? kShakenPositionSigma : kRestPositionSigma)),
      Vec3::Constant(w.at(k).attitude_held ? information(kRestAttitudeSigma) : 0);
  const Vec6 weighted = known.cwiseProduct(r);
  if (out) {
    const Mat3 J_inv = so3_right_jacobian_inverse(r.tail<3>());
    Mat6 J_k = Mat6::Identity(), J_l = -Mat6::Identity();
    J_k.bottomRightCorner<3, 3>() = J_inv;
    J_l.bottomRightCorner<3, 3>() = -J_inv * x_k.R.transpose() * x_l.R;
    const Mat6 W_k = known.asDiagonal() * J_k, W_l = known.asDiagonal() * J_l;
    out->add(pose_of(k), Vec6(-J_k.transpose() * weighted));
    out->add(pose_of(l), Vec6(-J_l.transpose() * weighted));
    out->add(pose_of(k), pose_of(k), Mat6(J_k.transpose() * W_k));
    out->add(pose_of(l), pose_of(l), Mat6(J_l.transpose() * W_l));
    out->add(pose_of(k), pose_of(l), Mat6(J_k.transpose() * W_l));
  }
  return r.dot(weighted);
}
}  // namespace

double add_zero_motion(const Window& w, const Share& share, NormalEquations* out) {
  double cost = 0;
  for (int k = 0; k < share.frames; ++k) {
    const Slot& s = w.at(k);
    if (!s.at_rest) continue;
    if (!share.oldest_only || k == 0) cost += add_velocity(w, k, out);
    const int l = s.rest_link ? w.index_of(s.rest_link) : -1;
    if (l >= 0 && (!share.oldest_only || l == 0)) cost += add_link(w, k, l, out);
  }
  return cost;
}

}  // namespace epiline
