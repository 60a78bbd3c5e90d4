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

// M <- F M.
template <int columns>
void apply(const Transition& F, Eigen::Matrix<double, 15, columns>& M) {
  using Rows = Eigen::Matrix<double, 3, columns>;
  const Rows theta = M.template middleRows<3>(kTheta), a = M.template middleRows<3>(kA),
             g = M.template middleRows<3>(kG);
  M.template middleRows<3>(kP) += F.T * M.template middleRows<3>(kV) + F.p_theta * theta + F.p_a * a + F.p_g * g;
  M.template middleRows<3>(kTheta) = F.theta_theta * theta + F.theta_g * g;
  M.template middleRows<3>(kV) += F.v_theta * theta + F.v_a * a + F.v_g * g;
}

// C <- F C F^T of a symmetric C. F leaves the biases, so only the nine upper rows of F C meet F^T; the rest is
// symmetry.
void apply_both_sides(const Transition& F, Mat15& C) {
  apply(F, C);
  Eigen::Matrix<double, 15, 9> M = C.topRows<9>().transpose();
  apply(F, M);
  C.topLeftCorner<9, 9>() = M.topRows<9>();
  C.bottomLeftCorner<6, 9>() = C.topRightCorner<9, 6>().transpose();
}

}  // namespace

void Preintegration::reset(const Vec3& b_a_hat, const Vec3& b_g_hat) {
  *this = {};
  b_a = b_a_hat;
  b_g = b_g_hat;
}

void Preintegration::integrate(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt,
                               const ImuNoise& noise) {
  const Vec3 w_dt = (0.5 * (w0 + w1) - b_g) * dt;
  const Vec3 f0 = a0 - b_a, f1 = a1 - b_a;
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

void Preintegration::corrected(const Vec3& b_a_new, const Vec3& b_g_new, Vec3& p, Vec3& v, Mat3& R) const {
  const Vec3 d_a = b_a_new - b_a, d_g = b_g_new - b_g;
  p = dp + J.block<3, 3>(kP, kA) * d_a + J.block<3, 3>(kP, kG) * d_g;
  v = dv + J.block<3, 3>(kV, kA) * d_a + J.block<3, 3>(kV, kG) * d_g;
  R = dR * so3_exp(J.block<3, 3>(kTheta, kG) * d_g);
}

void Preintegration::join(const Preintegration& next) {
  Vec3 p2, v2;
  Mat3 R2;
  next.corrected(b_a, b_g, p2, v2, R2);
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
