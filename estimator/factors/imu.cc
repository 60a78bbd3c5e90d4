#include "estimator/factors/imu.h"

#include <Eigen/Cholesky>

namespace epiline {

void evaluate_imu(const Preintegration& z, const NavState& x_i, const NavState& x_j, const NavState& l_i,
                  const NavState& l_j, ImuResidual& out) {
  const double T = z.T;
  Vec3 dp, dv;
  Mat3 dR;
  z.corrected(x_i.b_a, x_i.b_g, dp, dv, dR);
  const Mat3 R_iT = x_i.R.transpose();
  const Vec3 r_theta = so3_log(dR.transpose() * R_iT * x_j.R);
  out.r << R_iT * (x_j.p - x_i.p - x_i.v * T - 0.5 * kGravity_W * T * T) - dp, r_theta,
      R_iT * (x_j.v - x_i.v - kGravity_W * T) - dv, x_j.b_a - x_i.b_a, x_j.b_g - x_i.b_g;

  constexpr int p = 0, th = 3, v = 6, ba = 9, bg = 12, j = 15;
  const Mat3 L_iT = l_i.R.transpose(), J_inv = so3_right_jacobian_inverse(r_theta);
  out.J.setZero();
  auto block = [&](int row, int col) { return out.J.block<3, 3>(row, col); };
  block(p, p) = -L_iT;
  block(p, j + p) = L_iT;
  block(p, th) = skew(L_iT * (l_j.p - l_i.p - l_i.v * T - 0.5 * kGravity_W * T * T));
  block(p, v) = -L_iT * T;
  block(p, ba) = -z.J.block<3, 3>(p, ba);
  block(p, bg) = -z.J.block<3, 3>(p, bg);
  block(th, th) = -J_inv * l_j.R.transpose() * l_i.R;
  block(th, j + th) = J_inv;
  const Mat3 J_theta_g = z.J.block<3, 3>(th, bg);
  block(th, bg) = -J_inv * so3_exp(r_theta).transpose() * so3_right_jacobian(J_theta_g * (x_i.b_g - z.b_g)) * J_theta_g;
  block(v, th) = skew(L_iT * (l_j.v - l_i.v - kGravity_W * T));
  block(v, v) = -L_iT;
  block(v, j + v) = L_iT;
  block(v, ba) = -z.J.block<3, 3>(v, ba);
  block(v, bg) = -z.J.block<3, 3>(v, bg);
  block(ba, ba) = block(bg, bg) = -Mat3::Identity();
  block(ba, j + ba) = block(bg, j + bg) = Mat3::Identity();
}

bool square_root_information(const Preintegration& z, Mat15& L_inverse) {
  Mat15 C = z.C;
  // A single midpoint step correlates p and v fully. One millionth more variance of p makes that positive definite.
  C.diagonal().head<3>() *= 1 + 1e-6;
  const Eigen::LLT<Mat15> cholesky(C);
  if (cholesky.info() != Eigen::Success) return false;
  L_inverse.setIdentity();
  cholesky.matrixL().solveInPlace(L_inverse);
  return true;
}

}  // namespace epiline
