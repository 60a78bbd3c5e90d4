#pragma once
// Velocity between a frame's instant and the stamp that its pose is published with.
#include "estimator/geometry/so3.h"
#include "estimator/inertial/imu_history.h"

namespace epiline {

/// By how much the readings change the velocity from `x`, a state at `from`, to another instant before or after it; W.
/// For the few milliseconds of a camera's time offset: attitude before `from` follows from the rate there, `omega_B`
/// (bias removed).
inline Vec3 velocity_gained(const ImuHistory& history, const NavState& x, const Vec3& omega_B, HostStamp from,
                            HostStamp to) {
  NavState moved = x;
  moved.v.setZero();
  Vec3 rate;
  if (to >= from) {
    history.propagate(from, to, moved, rate);
    return moved.v;
  }
  moved.R = x.R * so3_exp(omega_B * (to - from).seconds());
  history.propagate(to, from, moved, rate);
  return -moved.v;
}

}  // namespace epiline
