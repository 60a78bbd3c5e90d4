#include "estimator/factors/wheel.h"

#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

void evaluate_wheel(const WheelModel& wheel, double speed_m_s, const Vec3& omega, const NavState& x, const NavState& l,
                    WheelResidual& out) {
  const Vec3& e = wheel.forward_B;
  out.r = e.dot(x.R.transpose() * x.v + (omega - x.b_g).cross(wheel.p_BV)) - speed_m_s;

  const Mat3 L_T = l.R.transpose();
  out.J.setZero();
  out.J.segment<3>(3) = e.transpose() * skew(L_T * l.v);
  out.J.segment<3>(6) = e.transpose() * L_T;
  out.J.segment<3>(12) = e.transpose() * skew(wheel.p_BV);

  const double information = 1 / (wheel.sigma_m_s * wheel.sigma_m_s), c2 = wheel.cauchy * wheel.cauchy;
  const double s = out.r * out.r * information / c2;
  out.weight = information / (1 + s);
  out.cost = c2 * std::log1p(s);
}

double add_wheel(const Window& w, const Share& share, NormalEquations* out) {
  double cost = 0;
  const int end = share.oldest_only ? 1 : share.frames;
  for (int k = 0; k < end; ++k) {
    const Slot& slot = w.at(k);
    if (!slot.has_wheel) continue;
    WheelResidual f;
    evaluate_wheel(w.wheel, slot.wheel_speed_m_s, slot.omega, slot.x, w.linearisation_point(k), f);
    cost += f.cost;
    if (!out) continue;
    const Vec6 J_pose = f.J.head<6>();
    const Vec9 J_velocity = f.J.tail<9>();
    const auto H = [&](const auto& a, const auto& b) { return (f.weight * a * b.transpose()).eval(); };
    out->add(pose_of(k), Vec6(-f.weight * f.r * J_pose));
    out->add(velocity_biases_of(k), Vec9(-f.weight * f.r * J_velocity));
    out->add(pose_of(k), pose_of(k), H(J_pose, J_pose));
    out->add(pose_of(k), velocity_biases_of(k), H(J_pose, J_velocity));
    out->add(velocity_biases_of(k), velocity_biases_of(k), H(J_velocity, J_velocity));
  }
  return cost;
}

}  // namespace epiline
