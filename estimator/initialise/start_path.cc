#include "estimator/initialise/start_path.h"

#include <Eigen/Geometry>

#include "estimator/geometry/so3.h"

namespace epiline {

Eigen::Matrix<double, 3, 2> gravity_basis(const Vec3& g) {
  const Vec3 n = g.normalized();
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = n.unitOrthogonal();
  B.col(1) = n.cross(B.col(0));
  return B;
}

StartState moved(const StartState& state, const StartVector& d) {
  StartState s = state;
  s.v_0 += d.segment<3>(0);
  s.g_0 = (state.g_0 + kGravity * (gravity_basis(state.g_0) * d.segment<2>(3))).normalized() * kGravity;
  s.b_g += d.segment<3>(5);
  s.b_a += d.segment<3>(8);
  return s;
}

StartRows StartFrame::position_rows(const Vec3& g_0) const {
  StartRows J;
  J.leftCols<3>() = Mat3::Identity() * T;
  J.middleCols<2>(3) = (0.5 * T * T * kGravity) * gravity_basis(g_0);
  J.rightCols<6>() = alpha_b;
  return J;
}

namespace {

StartFrame next(const StartFrame& f, const Preintegration& interval, const Vec3& b_g, const Vec3& b_a) {
  Vec3 dp, dv;
  Mat3 dR;
  interval.corrected(b_a, b_g, interval.scale, dp, dv, dR);
  Eigen::Matrix<double, 3, 6> p_b, v_b;
  p_b << interval.J.block<3, 3>(0, 12), interval.J.block<3, 3>(0, 9);
  v_b << interval.J.block<3, 3>(6, 12), interval.J.block<3, 3>(6, 9);
  p_b.leftCols<3>() -= skew(dp) * f.theta_b;
  v_b.leftCols<3>() -= skew(dv) * f.theta_b;
  StartFrame n;
  n.T = f.T + interval.T;
  n.R = f.R * dR;
  n.alpha = f.alpha + f.beta * interval.T + f.R * dp;
  n.beta = f.beta + f.R * dv;
  n.alpha_b = f.alpha_b + f.beta_b * interval.T + f.R * p_b;
  n.beta_b = f.beta_b + f.R * v_b;
  n.theta_b = dR.transpose() * f.theta_b + interval.J.block<3, 3>(3, 12);
  return n;
}

}  // namespace

void chain(const StartProblem& problem, const Vec3& b_g, const Vec3& b_a, StartPath& path) {
  path[0] = StartFrame();
  for (int k = 0; k + 1 < problem.frames; ++k) path[k + 1] = next(path[k], problem.interval[k], b_g, b_a);
}

}  // namespace epiline
