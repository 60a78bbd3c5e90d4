#include "estimator/inertial/preintegration.h"

#include <algorithm>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

constexpr double kLeastUnknown_s = 1;  // how long an unknown acceleration lasts, at least
constexpr double kBiasSteps = 0.006;   // m/s^2, of the accelerometer where forces are doubted
constexpr int kP = 0, kTheta = 3, kV = 6, kA = 9, kG = 12;

auto block(Mat15& M, int row, int column) { return M.block<3, 3>(row, column); }
auto block(const Mat15& M, int row, int column) { return M.block<3, 3>(row, column); }

/// [x]x M.
Mat3 cross(const Vec3& x, const Mat3& M) {
  Mat3 r;
  for (int i = 0; i < 3; ++i) r.col(i) = x.cross(M.col(i));
  return r;
}

void set(int row, int column, const Mat3& B, Mat15& C) {
  block(C, row, column) = B;
  if (row != column) block(C, column, row) = B.transpose();
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
  Integration(*this).step(w0, a0, w1, a1, dt, noise);
}

Integration::Integration(Preintegration& interval) noexcept : z_(interval) {
  const Mat3& R = z_.dR;
  J_ = {.p_a = block(z_.J, kP, kA),
        .p_g = block(z_.J, kP, kG),
        .theta_g = R * block(z_.J, kTheta, kG),
        .v_a = block(z_.J, kV, kA),
        .v_g = block(z_.J, kV, kG)};
  z_.J_s_g.segment<3>(kTheta) = (R * z_.J_s_g.segment<3>(kTheta)).eval();
  const Mat15& C = z_.C;
  C_ = {.pp = block(C, kP, kP),
        .pt = block(C, kP, kTheta) * R.transpose(),
        .pv = block(C, kP, kV),
        .pa = block(C, kP, kA),
        .pg = block(C, kP, kG),
        .tt = R * block(C, kTheta, kTheta) * R.transpose(),
        .tg = R * block(C, kTheta, kG),
        .vt = block(C, kV, kTheta) * R.transpose(),
        .vv = block(C, kV, kV),
        .va = block(C, kV, kA),
        .vg = block(C, kV, kG),
        .a = C(kA, kA),
        .g = C(kG, kG)};
}

Integration::~Integration() {
  const Mat3& R = z_.dR;
  Mat15& J = z_.J;
  block(J, kP, kTheta) = -skew(z_.dp);
  block(J, kV, kTheta) = -skew(z_.dv);
  block(J, kTheta, kTheta) = R.transpose();
  block(J, kP, kV).diagonal().setConstant(z_.T);
  block(J, kP, kA) = J_.p_a;
  block(J, kP, kG) = J_.p_g;
  block(J, kTheta, kG) = R.transpose() * J_.theta_g;
  block(J, kV, kA) = J_.v_a;
  block(J, kV, kG) = J_.v_g;
  z_.J_s_g.segment<3>(kTheta) = (R.transpose() * z_.J_s_g.segment<3>(kTheta)).eval();
  Mat15& C = z_.C;
  set(kP, kP, C_.pp, C);
  set(kP, kTheta, C_.pt * R, C);
  set(kP, kV, C_.pv, C);
  set(kP, kA, C_.pa, C);
  set(kP, kG, C_.pg, C);
  set(kTheta, kTheta, R.transpose() * C_.tt * R, C);
  set(kTheta, kG, R.transpose() * C_.tg, C);
  set(kV, kTheta, C_.vt * R, C);
  set(kV, kV, C_.vv, C);
  set(kV, kA, C_.va, C);
  set(kV, kG, C_.vg, C);
  set(kA, kA, C_.a * Mat3::Identity(), C);
  set(kG, kG, C_.g * Mat3::Identity(), C);
}

void Integration::step(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt,
                       const ImuNoise& noise) noexcept {
  const double by_a = 1 + z_.scale.accelerometer, by_g = 1 + z_.scale.gyroscope;
  const Vec3 rate = 0.5 * (w0 + w1);
  const Vec3 turned = rate - z_.b_g, w_dt = by_g * dt * turned;
  const Mat3 R_end = z_.dR * so3_exp(w_dt);
  const Vec3 force = R_end * (by_a * (a1 - z_.b_a));
  const Vec3 a = 0.5 * (z_.dR * (by_a * (a0 - z_.b_a)) + force);

  // The exact derivative of this step, so that J is that of the sums and joining intervals loses nothing.
  Step s{.dt = dt, .turn = -dt * a, .by_a = -0.5 * dt * by_a * (z_.dR + R_end), .by_g = {}, .N = {}};
  s.N = dt * by_g * (R_end * so3_right_jacobian(w_dt));
  s.by_g = cross(0.5 * dt * force, s.N);
  move_derivatives(s, turned / by_g);
  move_covariance(s);
  add_noise(dt, noise);

  z_.dp += dt * z_.dv + 0.5 * dt * dt * a;
  z_.dv += dt * a;
  z_.dR = R_end;
  z_.T += dt;
}

/// The scale of the gyroscope does what a bias of -`by_s` would.
void Integration::move_derivatives(const Step& s, const Vec3& by_s) noexcept {
  const Mat3 d_g = cross(s.turn, J_.theta_g) + s.by_g;
  J_.p_a += s.dt * (J_.v_a + 0.5 * s.by_a);
  J_.p_g += s.dt * (J_.v_g + 0.5 * d_g);
  J_.v_a += s.by_a;
  J_.v_g += d_g;
  J_.theta_g -= s.N;
  auto p = z_.J_s_g.segment<3>(kP), theta = z_.J_s_g.segment<3>(kTheta), v = z_.J_s_g.segment<3>(kV);
  const Vec3 d = s.turn.cross(theta) - s.by_g * by_s;
  p += s.dt * (v + 0.5 * d);
  v += d;
  theta += s.N * by_s;
}

/// D_x below: covariance of d and x before the step. p' = p + dt v + dt/2 d.
void Integration::move_covariance(const Step& s) noexcept {
  Covariance& C = C_;
  const double dt = s.dt, h = 0.5 * dt;
  const Mat3 D_p = cross(s.turn, C.pt.transpose()) + s.by_a * C.pa.transpose() + s.by_g * C.pg.transpose();
  const Mat3 D_v = cross(s.turn, C.vt.transpose()) + s.by_a * C.va.transpose() + s.by_g * C.vg.transpose();
  const Mat3 D_t = cross(s.turn, C.tt) + s.by_g * C.tg.transpose();
  const Mat3 D_a = C.a * s.by_a;
  const Mat3 D_g = cross(s.turn, C.tg) + C.g * s.by_g;
  const Mat3 D_d = cross(s.turn, D_t.transpose()).transpose() + D_a * s.by_a.transpose() + D_g * s.by_g.transpose();
  const Mat3 half = dt * C.pv + h * D_p.transpose() + (h * dt) * D_v;
  C.pp += half + half.transpose() + (dt * dt) * C.vv + (h * h) * D_d;
  C.pv += D_p.transpose() + dt * (C.vv + D_v.transpose()) + h * (D_v + D_d);
  C.pa += dt * C.va + h * D_a;
  C.pg += dt * C.vg + h * D_g;
  C.pt += dt * C.vt + h * D_t - C.pg * s.N.transpose();
  C.vv += D_v + D_v.transpose() + D_d;
  C.va += D_a;
  C.vg += D_g;
  C.vt += D_t - C.vg * s.N.transpose();
  const Mat3 turned = C.tg * s.N.transpose();
  C.tt += C.g * s.N * s.N.transpose() - turned - turned.transpose();
  C.tg -= C.g * s.N;
}

void Integration::add_noise(double dt, const ImuNoise& noise) noexcept {
  const auto variance = [dt](double density) { return density * density * dt; };
  const double q_a = variance(noise.accelerometer_density);
  C_.pp.diagonal().array() += 0.25 * dt * dt * q_a;
  C_.pv.diagonal().array() += 0.5 * dt * q_a;
  C_.vv.diagonal().array() += q_a;
  C_.tt.diagonal().array() += variance(noise.gyroscope_density);
  C_.a += variance(noise.accelerometer_random_walk);
  C_.g += variance(noise.gyroscope_random_walk);
}

ScaleColumns Preintegration::by_scale() const {
  ScaleColumns columns;
  columns.col(0) << dp, Vec3::Zero(), dv;
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

void Preintegration::doubt_forces(double acceleration) {
  if (!(acceleration > 0)) return;
  const Mat3 a2 = acceleration * acceleration * Mat3::Identity();
  block(C, kP, kP) += T * T * T * T / 4 * a2;
  block(C, kP, kV) += T * T * T / 2 * a2;
  block(C, kV, kP) += T * T * T / 2 * a2;
  block(C, kV, kV) += T * T * a2;
  block(C, kA, kA).diagonal().array() += kBiasSteps * kBiasSteps;
}

void Preintegration::doubt_rates(double step) {
  const double half = 0.5 * step * step;
  C += half * J.middleCols<3>(kG) * J.middleCols<3>(kG).transpose();
  block(C, kG, kG).diagonal().array() += half;
}

void Preintegration::forget_forces(double acceleration) {
  const Mat3 q = acceleration * acceleration * std::max(T, kLeastUnknown_s) * Mat3::Identity();
  for (const int row : {kP, kV}) {
    J.middleRows<3>(row).setZero();
    block(J, row, row).setIdentity();
    C.middleRows<3>(row).setZero();
    C.middleCols<3>(row).setZero();
  }
  block(J, kP, kV) = T * Mat3::Identity();
  block(C, kP, kP) = T * T * T / 3 * q;
  set(kP, kV, T * T / 2 * q, C);
  block(C, kV, kV) = T * q;
}

void Preintegration::join(const Preintegration& next) {
  Vec3 p2, v2;
  Mat3 R2;
  next.corrected(b_a, b_g, scale, p2, v2, R2);
  // The biases stay as they are: nine rows move.
  Eigen::Matrix<double, 9, 15> A = Eigen::Matrix<double, 9, 15>::Identity();
  A.block<3, 3>(kP, kV).diagonal().setConstant(next.T);
  A.block<3, 3>(kP, kTheta) = -dR * skew(p2);
  A.block<3, 3>(kP, kA) = dR * next.J.block<3, 3>(kP, kA);
  A.block<3, 3>(kP, kG) = dR * next.J.block<3, 3>(kP, kG);
  A.block<3, 3>(kTheta, kTheta) = R2.transpose();
  A.block<3, 3>(kTheta, kG) = next.J.block<3, 3>(kTheta, kG);
  A.block<3, 3>(kV, kTheta) = -dR * skew(v2);
  A.block<3, 3>(kV, kA) = dR * next.J.block<3, 3>(kV, kA);
  A.block<3, 3>(kV, kG) = dR * next.J.block<3, 3>(kV, kG);
  J.topRows<9>() = A.lazyProduct(J).eval();
  J_s_g = (A.leftCols<9>() * J_s_g).eval();
  const Vec9 J2 = next.J_s_g;
  J_s_g.segment<3>(kP) += dR * J2.segment<3>(kP);
  J_s_g.segment<3>(kTheta) += J2.segment<3>(kTheta);
  J_s_g.segment<3>(kV) += dR * J2.segment<3>(kV);
  const Eigen::Matrix<double, 9, 15> A_C = A.lazyProduct(C);
  C.topLeftCorner<9, 9>() = A_C.lazyProduct(A.transpose());
  C.topRightCorner<9, 6>() = A_C.rightCols<6>();
  C.bottomLeftCorner<6, 9>() = A_C.rightCols<6>().transpose();

  // B C2 B^T: the second interval's p and v errors live in its own first body frame.
  Mat15 C2 = next.C;
  for (const int row : {kP, kV}) C2.middleRows<3>(row) = dR * next.C.middleRows<3>(row);
  for (const int col : {kP, kV}) C2.middleCols<3>(col) = (C2.middleCols<3>(col) * dR.transpose()).eval();
  C += C2;

  dp += next.T * dv + dR * p2;
  dv += dR * v2;
  dR = dR * R2;
  T += next.T;
  knows_motion = knows_motion && next.knows_motion;
}

}  // namespace epiline
