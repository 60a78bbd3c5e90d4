#include "estimator/factors/imu.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace epiline {

namespace {

/// What was estimated less what was read, in true units.
Vec15 difference(const Preintegration& z, const ImuScale& scale, const NavState& x_i, const NavState& x_j) {
  const double T = z.T;
  Vec3 dp, dv;
  Mat3 dR;
  z.corrected(x_i.b_a, x_i.b_g, scale, dp, dv, dR);
  const Mat3 R_iT = x_i.R.transpose();
  Vec15 r;
  r << R_iT * (x_j.p - x_i.p - x_i.v * T - 0.5 * kGravity_W * T * T) - dp, so3_log(dR.transpose() * R_iT * x_j.R),
      R_iT * (x_j.v - x_i.v - kGravity_W * T) - dv, x_j.b_a - x_i.b_a, x_j.b_g - x_i.b_g;
  return r;
}

/// From true units to those of the readings, in which the noise is known.
template <class Rows>
void to_readings(const ImuScale& scale, Rows& rows) {
  const double per_a = 1 / (1 + scale.accelerometer), per_g = 1 / (1 + scale.gyroscope);
  rows.template middleRows<3>(0) *= per_a;
  rows.template middleRows<3>(3) *= per_g;
  rows.template middleRows<3>(6) *= per_a;
}

}  // namespace

Vec15 imu_residual(const Preintegration& z, const ImuScale& scale, const NavState& x_i, const NavState& x_j) {
  Vec15 r = difference(z, scale, x_i, x_j);
  to_readings(scale, r);
  return r;
}

void evaluate_imu(const Preintegration& z, const ImuScale& scale, const NavState& x_i, const NavState& x_j,
                  ImuResidual& out) {
  const double T = z.T;
  out.r = difference(z, scale, x_i, x_j);
  const Vec3 r_theta = out.r.segment<3>(3);

  constexpr int p = 0, th = 3, v = 6, ba = 9, bg = 12, j = 15, sa = 30, sg = 31;
  const Mat3 R_iT = x_i.R.transpose(), J_inv = so3_right_jacobian_inverse(r_theta);
  out.J.setZero();
  auto block = [&](int row, int col) { return out.J.block<3, 3>(row, col); };
  block(p, p) = -R_iT;
  block(p, j + p) = R_iT;
  block(p, th) = skew(R_iT * (x_j.p - x_i.p - x_i.v * T - 0.5 * kGravity_W * T * T));
  block(p, v) = -R_iT * T;
  block(p, ba) = -z.J.block<3, 3>(p, ba);
  block(p, bg) = -z.J.block<3, 3>(p, bg);
  block(th, th) = -J_inv * x_j.R.transpose() * x_i.R;
  block(th, j + th) = J_inv;
  const Mat3 J_theta_g = z.J.block<3, 3>(th, bg);
  const Vec3 J_theta_s = z.J_s_g.segment<3>(th);
  const Vec3 moved = J_theta_g * (x_i.b_g - z.b_g) + J_theta_s * (scale.gyroscope - z.scale.gyroscope);
  const Mat3 by_moved = J_inv * so3_exp(r_theta).transpose() * so3_right_jacobian(moved);
  block(th, bg) = -by_moved * J_theta_g;
  out.J.block<3, 1>(th, sg) = -by_moved * J_theta_s;
  block(v, th) = skew(R_iT * (x_j.v - x_i.v - kGravity_W * T));
  block(v, v) = -R_iT;
  block(v, j + v) = R_iT;
  block(v, ba) = -z.J.block<3, 3>(v, ba);
  block(v, bg) = -z.J.block<3, 3>(v, bg);
  const ScaleColumns by_scale = z.by_scale();
  for (const int row : {p, v}) out.J.block<3, 2>(row, sa) = -by_scale.middleRows<3>(row);
  block(ba, ba) = block(bg, bg) = -Mat3::Identity();
  block(ba, j + ba) = block(bg, j + bg) = Mat3::Identity();
  to_readings(scale, out.r);
  to_readings(scale, out.J);
  const double per_a = 1 / (1 + scale.accelerometer), per_g = 1 / (1 + scale.gyroscope);
  for (const int row : {p, v}) out.J.block<3, 1>(row, sa) -= per_a * out.r.segment<3>(row);
  out.J.block<3, 1>(th, sg) -= per_g * out.r.segment<3>(th);
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

bool whiten(Slot& slot) {
  Mat15 L_inverse;
  if (!square_root_information(slot.imu, L_inverse) || !L_inverse.allFinite()) return false;
  if (!slot.imu.knows_motion) {
    const Vec15 walked = slot.imu.C.diagonal().cwiseSqrt();
    L_inverse.setZero();
    L_inverse.diagonal().tail<6>() = walked.tail<6>().cwiseInverse();
  }
  slot.L_inverse.leftCols<15>() = L_inverse;
  return true;
}

double imu_chi2(const Window& w, int k) {
  const Slot& slot = w.at(k);
  const Vec15 r = imu_residual(slot.imu, w.calibration.scale, w.at(k - 1).x, slot.x);
  return (slot.L_inverse.leftCols<15>().triangularView<Eigen::Lower>() * r).squaredNorm();
}

double imu_chi2_of_turn(const Window& w, int k) {
  const Slot& slot = w.at(k);
  if (!slot.imu.knows_motion) return 0;
  const Mat15& C = slot.imu.C;
  const Vec15 r = imu_residual(slot.imu, w.calibration.scale, w.at(k - 1).x, slot.x);
  Vec6 r_turn;
  r_turn << r.segment<3>(3), r.segment<3>(12);
  Mat6 C_turn;
  C_turn << C.block<3, 3>(3, 3), C.block<3, 3>(3, 12), C.block<3, 3>(12, 3), C.block<3, 3>(12, 12);
  return r_turn.dot(C_turn.ldlt().solve(r_turn));
}

namespace {

/// Between frames k-1 and k.
double add_interval(const Window& w, int k, const FactorKernels& kernels, NormalEquations& out) {
  const Slot& slot = w.at(k);
  ImuResidual f;
  evaluate_imu(slot.imu, w.calibration.scale, w.at(k - 1).x, slot.x, f);
  alignas(64) double A[32][32], g[32];
  const double cost = kernels.imu(slot.L_inverse.data(), f.J.data(), f.r.data(), A, g);
  using Rows = Eigen::Matrix<double, 32, 32, Eigen::RowMajor>;
  const Eigen::Map<const Rows> H(A[0]);
  const Unknown pose_i = pose_of(k - 1), pose_j = pose_of(k), velocity_i = velocity_biases_of(k - 1),
                velocity_j = velocity_biases_of(k), scales = imu_scales();
  out.add(pose_i, Eigen::Map<const Vec6>(g));
  out.add(velocity_i, Eigen::Map<const Vec9>(g + 6));
  out.add(pose_j, Eigen::Map<const Vec6>(g + 15));
  out.add(velocity_j, Eigen::Map<const Vec9>(g + 21));
  out.add(pose_i, pose_i, H.block<6, 6>(0, 0));
  out.add(pose_i, velocity_i, H.block<6, 9>(0, 6));
  out.add(pose_i, pose_j, H.block<6, 6>(0, 15));
  out.add(pose_i, velocity_j, H.block<6, 9>(0, 21));
  out.add(velocity_i, velocity_i, H.block<9, 9>(6, 6));
  out.add(velocity_i, pose_j, H.block<9, 6>(6, 15));
  out.add(velocity_i, velocity_j, H.block<9, 9>(6, 21));
  out.add(pose_j, pose_j, H.block<6, 6>(15, 15));
  out.add(pose_j, velocity_j, H.block<6, 9>(15, 21));
  out.add(velocity_j, velocity_j, H.block<9, 9>(21, 21));
  out.add(scales, Eigen::Map<const Eigen::Vector2d>(g + 30));
  out.add(pose_i, scales, H.block<6, 2>(0, 30));
  out.add(velocity_i, scales, H.block<9, 2>(6, 30));
  out.add(pose_j, scales, H.block<6, 2>(15, 30));
  out.add(velocity_j, scales, H.block<9, 2>(21, 30));
  out.add(scales, scales, H.block<2, 2>(30, 30));
  return cost;
}

}  // namespace

double add_imu(const Window& w, const Share& share, const FactorKernels& kernels, NormalEquations* out) {
  const int end = share.oldest_only ? std::min(2, share.frames) : share.frames;
  double cost = 0;
  for (int k = 1; k < end; ++k) cost += out ? add_interval(w, k, kernels, *out) : imu_chi2(w, k);
  return cost;
}

}  // namespace epiline
