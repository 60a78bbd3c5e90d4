#include "estimator/inertial/wheel_way.h"

namespace epiline {

void WheelWay::join(const Mat3& dR, const WheelWay& next) noexcept {
  mixed = mixed || next.mixed || (known && next.known && slips);
  known = known && next.known && !mixed;
  slips = next.slips;
  moved += next.moved;
  way += dR * next.way;
  axis_s += dR * next.axis_s;
  time_of_one_s2 += next.time_of_one_s2;
}

bool integrate_way(const ScalarHistory& speeds, const ImuHistory& imu, HostStamp t0, HostStamp t1,
                   const Vec3& forward_B, const Vec3& b_g, const ImuScale& scale, WheelWay& out) noexcept {
  WheelWay sum;
  NavState x{.b_g = b_g};
  using Reading = ScalarHistory::Reading;
  sum.known = speeds.each_piece(t0, t1, [&](const Reading& from, const Reading& to, Span between) {
    const double dt = (to.stamp - from.stamp).seconds();
    const Vec3 e0 = x.R * forward_B;
    Vec3 omega;
    imu.propagate(from.stamp, to.stamp, scale, x, omega);
    const Vec3 e1 = x.R * forward_B;
    sum.way += 0.5 * dt * (from.value * e0 + to.value * e1);
    sum.axis_s += 0.5 * dt * (e0 + e1);
    sum.time_of_one_s2 += dt * between.seconds();
  });
  if (sum.known) out = sum;
  return sum.known;
}

}  // namespace epiline
