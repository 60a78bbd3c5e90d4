#include "estimator/factors/wheel.h"

#include <algorithm>
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

bool WheelHistory::push(const WheelSample& sample) noexcept {
  if (!std::isfinite(sample.forward_speed_m_s)) return false;
  if (pushed_ > 0 && sample.stamp <= back(0).stamp) return false;
  readings_[pushed_++ % kMost] = {sample.stamp, sample.forward_speed_m_s};
  return true;
}

bool WheelHistory::speed_at(HostStamp stamp, double& speed_m_s) const noexcept {
  const std::size_t count = std::min(pushed_, kMost);
  for (std::size_t i = 0; i < count; ++i) {
    const Reading& before = back(i);
    if (before.stamp > stamp) continue;
    if (before.stamp == stamp) {
      speed_m_s = before.speed_m_s;
      return true;
    }
    if (i == 0) return false;
    const Reading& after = back(i - 1);
    const Span between = after.stamp - before.stamp;
    if (between > kLongest) return false;
    const double part = (stamp - before.stamp).seconds() / between.seconds();
    speed_m_s = before.speed_m_s + part * (after.speed_m_s - before.speed_m_s);
    return true;
  }
  return false;
}

}  // namespace epiline
