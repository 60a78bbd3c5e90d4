#include "estimator/inertial/preintegration.h"

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr int kP = 0, kTheta = 3, kV = 6, kA = 9, kG = 12;

// The transition of the error state over a piece of an interval; blocks not listed are those of the identity.
//   | I  p_theta      T I  p_a  p_g     |
//   | 0  theta_theta  0    0    theta_g |
//   | 0  v_theta      I    v_a  v_g     |
struct Transition {
  double T;
  Mat3 p_theta, p_a, p_g, theta_theta, theta_g, v_theta, v_a, v_g;
};

auto block(Mat15& M, int row, int column) { return M.block<3, 3>(row, column); }

// J <- F J. The end's attitude does not depend on the accelerometer's bias, nor the end's position on the start's but
// as it is: of the 25 blocks six need a product.
void apply(const Transition& F, Mat15& J) {
  const Mat3 theta = block(J, kTheta, kTheta), theta_g = block(J, kTheta, kG);
  for (const int column : {kTheta, kV, kA, kG}) block(J, kP, column) += F.T * block(J, kV, column);
  block(J, kP, kTheta) += F.p_theta * theta;
  block(J, kP, kA) += F.p_a;
  block(J, kP, kG) += F.p_theta * theta_g + F.p_g;
  block(J, kV, kTheta) += F.v_theta * theta;
  block(J, kV, kA) += F.v_a;
  block(J, kV, kG) += F.v_theta * theta_g + F.v_g;
  block(J, kTheta, kTheta) = F.theta_theta * theta;
  block(J, kTheta, kG) = F.theta_theta * theta_g + F.theta_g;
}

// J_s_g <- F J_s_g, where the scale also does what a bias of -w would.
void apply(const Transition& F, const Vec3& w, Vec9& J_s_g) {
  const Vec3 theta = J_s_g.segment<3>(kTheta);
  J_s_g.segment<3>(kP) += F.T * J_s_g.segment<3>(kV) + F.p_theta * theta - F.p_g * w;
  J_s_g.segment<3>(kV) += F.v_theta * theta - F.v_g * w;
  J_s_g.segment<3>(kTheta) = F.theta_theta * theta - F.theta_g * w;
}

// C <- F C F^T of a symmetric C in which the biases know nothing of each other, the accelerometer's bias nothing of the
// attitude, and the biases' own blocks are multiples of one.
void apply_both_sides(const Transition& F, Mat15& C) {
  const double a = C(kA, kA), g = C(kG, kG);
  const Mat3 C_pt = block(C, kP, kTheta), C_tt = block(C, kTheta, kTheta), C_tv = block(C, kTheta, kV),
             C_tg = block(C, kTheta, kG), C_pa = block(C, kP, kA), C_pg = block(C, kP, kG), C_va = block(C, kV, kA),
             C_vg = block(C, kV, kG), C_pv = block(C, kP, kV), C_vv = block(C, kV, kV);
  // G = F C, the blocks that are needed
  const Mat3 G_pt = C_pt + F.T * C_tv.transpose() + F.p_theta * C_tt + F.p_g * C_tg.transpose();
  const Mat3 G_pv = C_pv + F.T * C_vv + F.p_theta * C_tv + F.p_a * C_va.transpose() + F.p_g * C_vg.transpose();
  const Mat3 G_pp = block(C, kP, kP) + F.T * C_pv.transpose() + F.p_theta * C_pt.transpose() +
                    F.p_a * C_pa.transpose() + F.p_g * C_pg.transpose();
  const Mat3 G_pa = C_pa + F.T * C_va + a * F.p_a;
  const Mat3 G_pg = C_pg + F.T * C_vg + F.p_theta * C_tg + g * F.p_g;
  const Mat3 G_tt = F.theta_theta * C_tt + F.theta_g * C_tg.transpose();
  const Mat3 G_tv = F.theta_theta * C_tv + F.theta_g * C_vg.transpose();
  const Mat3 G_tg = F.theta_theta * C_tg + g * F.theta_g;
  const Mat3 G_vt = C_tv.transpose() + F.v_theta * C_tt + F.v_g * C_tg.transpose();
  const Mat3 G_vv = C_vv + F.v_theta * C_tv + F.v_a * C_va.transpose() + F.v_g * C_vg.transpose();
  const Mat3 G_va = C_va + a * F.v_a;
  const Mat3 G_vg = C_vg + F.v_theta * C_tg + g * F.v_g;
  const auto set = [&](int row, int column, const Mat3& B) {
    block(C, row, column) = B;
    if (row != column) block(C, column, row) = B.transpose();
  };
  set(kP, kP, G_pp + F.T * G_pv + G_pt * F.p_theta.transpose() + G_pa * F.p_a.transpose() + G_pg * F.p_g.transpose());
  set(kP, kTheta, G_pt * F.theta_theta.transpose() + G_pg * F.theta_g.transpose());
  set(kP, kV, G_pv + G_pt * F.v_theta.transpose() + G_pa * F.v_a.transpose() + G_pg * F.v_g.transpose());
  set(kP, kA, G_pa);
  set(kP, kG, G_pg);
  set(kTheta, kTheta, G_tt * F.theta_theta.transpose() + G_tg * F.theta_g.transpose());
  set(kTheta, kV, G_tv + G_tt * F.v_theta.transpose() + G_tg * F.v_g.transpose());
  set(kTheta, kG, G_tg);
  set(kV, kV, G_vv + G_vt * F.v_theta.transpose() + G_va * F.v_a.transpose() + G_vg * F.v_g.transpose());
  set(kV, kA, G_va);
  set(kV, kG, G_vg);
}

}  // namespace

void Preintegration::reset(const Vec3& b_a_hat, const Vec3& b_g_hat, const ImuScale& scale_hat) {
  *this = {};
  b_a = b_a_hat;
  b_g = b_g_hat;
  scale = scale_hat;
}

void Preintegration::integrate(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt,
                               const ImuNoise& noise) {
  const double by_a = 1 + scale.accelerometer, by_g = 1 + scale.gyroscope;
  const Vec3 rate = 0.5 * (w0 + w1);
  const Vec3 w_dt = (by_g * rate - b_g) * dt;
  const Vec3 f0 = by_a * a0 - b_a, f1 = by_a * a1 - b_a;
  const Mat3 step = so3_exp(w_dt), J_r = so3_right_jacobian(w_dt);
  const Mat3 R_end = dR * step;
  const Vec3 a = 0.5 * (dR * f0 + R_end * f1);

  // F: the exact derivative of this step, so that J is that of the sums and joining intervals loses nothing.
  const Mat3 A = -dt * (skew(a) * dR), B = -0.5 * dt * (dR + R_end), G = 0.5 * dt * dt * (R_end * skew(f1) * J_r);
  const Transition F{.T = dt,
                     .p_theta = 0.5 * dt * A,
                     .p_a = 0.5 * dt * B,
                     .p_g = 0.5 * dt * G,
                     .theta_theta = step.transpose(),
                     .theta_g = -dt * J_r,
                     .v_theta = A,
                     .v_a = B,
                     .v_g = G};
  apply(F, J);
  apply(F, rate, J_s_g);
  apply_both_sides(F, C);

  const double q_a = noise.accelerometer_density * noise.accelerometer_density * dt;
  const double q_g = noise.gyroscope_density * noise.gyroscope_density * dt;
  const double q_aw = noise.accelerometer_random_walk * noise.accelerometer_random_walk * dt;
  const double q_gw = noise.gyroscope_random_walk * noise.gyroscope_random_walk * dt;
  for (int i = 0; i < 3; ++i) {
    C(kP + i, kP + i) += 0.25 * dt * dt * q_a;
    C(kP + i, kV + i) += 0.5 * dt * q_a;
    C(kV + i, kP + i) += 0.5 * dt * q_a;
    C(kV + i, kV + i) += q_a;
    C(kTheta + i, kTheta + i) += q_g;
    C(kA + i, kA + i) += q_aw;
    C(kG + i, kG + i) += q_gw;
  }

  dp += dt * dv + 0.5 * dt * dt * a;
  dv += dt * a;
  dR = R_end;
  T += dt;
}

// The readings' own sums are what is integrated less the biases' part.
ScaleColumns Preintegration::by_scale() const {
  ScaleColumns columns;
  columns.col(0) << dp - J.block<3, 3>(kP, kA) * b_a, Vec3::Zero(), dv - J.block<3, 3>(kV, kA) * b_a;
  columns.col(0) /= 1 + scale.accelerometer;
  columns.col(1) = J_s_g;
  return columns;
}

void Preintegration::corrected(const Vec3& b_a_new, const Vec3& b_g_new, const ImuScale& scale_new, Vec3& p, Vec3& v,
                               Mat3& R) const {
  const Vec3 d_a = b_a_new - b_a, d_g = b_g_new - b_g;
  const Eigen::Vector2d d_s(scale_new.accelerometer - scale.accelerometer, scale_new.gyroscope - scale.gyroscope);
  const Vec9 by_s = by_scale() * d_s;
  p = dp + J.block<3, 3>(kP, kA) * d_a + J.block<3, 3>(kP, kG) * d_g + by_s.segment<3>(kP);
  v = dv + J.block<3, 3>(kV, kA) * d_a + J.block<3, 3>(kV, kG) * d_g + by_s.segment<3>(kV);
  R = dR * so3_exp(J.block<3, 3>(kTheta, kG) * d_g + by_s.segment<3>(kTheta));
}

void Preintegration::join(const Preintegration& next) {
  Vec3 p2, v2;
  Mat3 R2;
  next.corrected(b_a, b_g, scale, p2, v2, R2);
  const Transition A{.T = next.T,
                     .p_theta = -dR * skew(p2),
                     .p_a = dR * next.J.block<3, 3>(kP, kA),
                     .p_g = dR * next.J.block<3, 3>(kP, kG),
                     .theta_theta = R2.transpose(),
                     .theta_g = next.J.block<3, 3>(kTheta, kG),
                     .v_theta = -dR * skew(v2),
                     .v_a = dR * next.J.block<3, 3>(kV, kA),
                     .v_g = dR * next.J.block<3, 3>(kV, kG)};
  apply(A, J);
  apply(A, Vec3::Zero(), J_s_g);
  const Vec9 J2 = next.J_s_g;
  J_s_g.segment<3>(kP) += dR * J2.segment<3>(kP);
  J_s_g.segment<3>(kTheta) += J2.segment<3>(kTheta);
  J_s_g.segment<3>(kV) += dR * J2.segment<3>(kV);
  apply_both_sides(A, C);

  // B C2 B^T: the second interval's p and v errors live in its own first body frame.
  Mat15 C2 = next.C;
  for (const int row : {kP, kV}) C2.middleRows<3>(row) = dR * next.C.middleRows<3>(row);
  for (const int col : {kP, kV}) C2.middleCols<3>(col) = (C2.middleCols<3>(col) * dR.transpose()).eval();
  C += C2;

  dp += next.T * dv + dR * p2;
  dv += dR * v2;
  dR = dR * R2;
  T += next.T;
}

}  // namespace epiline
