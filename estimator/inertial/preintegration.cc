#include "estimator/inertial/preintegration.h"

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr int kP = 0, kTheta = 3, kV = 6, kA = 9, kG = 12;

// The transition of the error state over a step of dt: the biases stay, the position follows the mean velocity.
//   theta' = theta_theta theta + theta_g b_g
//   v'     = v + v_theta theta + v_a b_a + v_g b_g
//   p'     = p + dt/2 (v + v')
struct Step {
  double dt;
  Mat3 theta_theta, theta_g, v_theta, v_a, v_g;
};

auto block(Mat15& M, int row, int column) { return M.block<3, 3>(row, column); }

// J <- F J
void apply(const Step& F, Mat15& J) {
  const Mat3 theta = block(J, kTheta, kTheta), theta_g = block(J, kTheta, kG);
  const Mat3 by_theta = F.v_theta * theta, by_g = F.v_theta * theta_g + F.v_g;
  block(J, kP, kV).diagonal().array() += F.dt;
  block(J, kP, kTheta) += F.dt * (block(J, kV, kTheta) + 0.5 * by_theta);
  block(J, kP, kA) += F.dt * (block(J, kV, kA) + 0.5 * F.v_a);
  block(J, kP, kG) += F.dt * (block(J, kV, kG) + 0.5 * by_g);
  block(J, kV, kTheta) += by_theta;
  block(J, kV, kA) += F.v_a;
  block(J, kV, kG) += by_g;
  block(J, kTheta, kTheta).noalias() = F.theta_theta * theta;
  block(J, kTheta, kG) = F.theta_theta * theta_g + F.theta_g;
}

// J_s_g <- F J_s_g, where the scale also does what a bias of -w would.
void apply(const Step& F, const Vec3& w, Vec9& J_s_g) {
  const Vec3 theta = J_s_g.segment<3>(kTheta), v = J_s_g.segment<3>(kV);
  J_s_g.segment<3>(kV) += F.v_theta * theta - F.v_g * w;
  J_s_g.segment<3>(kP) += 0.5 * F.dt * (v + J_s_g.segment<3>(kV));
  J_s_g.segment<3>(kTheta) = F.theta_theta * theta - F.theta_g * w;
}

// C <- F C F^T of a symmetric C in which the biases know nothing of each other, the accelerometer's bias nothing of the
// attitude, and the biases' own blocks are multiples of one. X_yz below: covariance of y before and z after; N_yz: of
// both after.
void apply_both_sides(const Step& F, Mat15& C) {
  const double a = C(kA, kA), g = C(kG, kG), h = 0.5 * F.dt;
  const Mat3 C_pp = block(C, kP, kP), C_pt = block(C, kP, kTheta), C_pv = block(C, kP, kV), C_pa = block(C, kP, kA),
             C_pg = block(C, kP, kG), C_tt = block(C, kTheta, kTheta), C_tg = block(C, kTheta, kG),
             C_vt = block(C, kV, kTheta), C_vv = block(C, kV, kV), C_va = block(C, kV, kA), C_vg = block(C, kV, kG);
  const auto E_t = F.theta_theta.transpose(), G_t = F.theta_g.transpose();
  const Mat3 N_tg = F.theta_theta * C_tg + g * F.theta_g;
  const Mat3 N_va = C_va + a * F.v_a;
  const Mat3 N_vg = C_vg + F.v_theta * C_tg + g * F.v_g;
  const Mat3 X_tt = C_tt * E_t + C_tg * G_t, X_vt = C_vt * E_t + C_vg * G_t, X_pt = C_pt * E_t + C_pg * G_t;
  const Mat3 X_tv = C_vt.transpose() + C_tt * F.v_theta.transpose() + C_tg * F.v_g.transpose();
  const Mat3 X_vv = C_vv + C_vt * F.v_theta.transpose() + C_va * F.v_a.transpose() + C_vg * F.v_g.transpose();
  const Mat3 X_pv = C_pv + C_pt * F.v_theta.transpose() + C_pa * F.v_a.transpose() + C_pg * F.v_g.transpose();
  const Mat3 N_vt = X_vt + F.v_theta * X_tt + F.v_g * N_tg.transpose();
  const Mat3 N_vv = X_vv + F.v_theta * X_tv + F.v_a * N_va.transpose() + F.v_g * N_vg.transpose();
  const auto set = [&](int row, int column, const Mat3& B) {
    block(C, row, column) = B;
    if (row != column) block(C, column, row) = B.transpose();
  };
  const Mat3 half = h * (C_pv + X_pv) + h * h * X_vv;
  set(kP, kP, C_pp + half + half.transpose() + h * h * (C_vv + N_vv));
  set(kP, kTheta, X_pt + h * (X_vt + N_vt));
  set(kP, kV, X_pv + h * (X_vv + N_vv));
  set(kP, kA, C_pa + h * (C_va + N_va));
  set(kP, kG, C_pg + h * (C_vg + N_vg));
  set(kTheta, kTheta, F.theta_theta * X_tt + F.theta_g * N_tg.transpose());
  set(kTheta, kV, N_vt.transpose());
  set(kTheta, kG, N_tg);
  set(kV, kV, N_vv);
  set(kV, kA, N_va);
  set(kV, kG, N_vg);
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
  const Step F{.dt = dt,
               .theta_theta = step.transpose(),
               .theta_g = -dt * J_r,
               .v_theta = -dt * (skew(a) * dR),
               .v_a = -0.5 * dt * (dR + R_end),
               .v_g = 0.5 * dt * dt * (R_end * skew(f1) * J_r)};
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
  Mat15 A = Mat15::Identity();
  block(A, kP, kV).diagonal().setConstant(next.T);
  block(A, kP, kTheta) = -dR * skew(p2);
  block(A, kP, kA) = dR * next.J.block<3, 3>(kP, kA);
  block(A, kP, kG) = dR * next.J.block<3, 3>(kP, kG);
  block(A, kTheta, kTheta) = R2.transpose();
  block(A, kTheta, kG) = next.J.block<3, 3>(kTheta, kG);
  block(A, kV, kTheta) = -dR * skew(v2);
  block(A, kV, kA) = dR * next.J.block<3, 3>(kV, kA);
  block(A, kV, kG) = dR * next.J.block<3, 3>(kV, kG);
  J = (A * J).eval();
  J_s_g = (A.topLeftCorner<9, 9>() * J_s_g).eval();
  const Vec9 J2 = next.J_s_g;
  J_s_g.segment<3>(kP) += dR * J2.segment<3>(kP);
  J_s_g.segment<3>(kTheta) += J2.segment<3>(kTheta);
  J_s_g.segment<3>(kV) += dR * J2.segment<3>(kV);
  C = (A * C * A.transpose()).eval();

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
