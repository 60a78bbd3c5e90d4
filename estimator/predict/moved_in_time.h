#pragma once
// A state at another instant: between a frame's exposure and the stamp that its pose is published with.
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/nav_state.h"

namespace epiline {

/// Moves the state `x` from the instant `from` to `to`, earlier or later, by the IMU samples between them, multiplied
/// by 1 + `scale`. Moving it back gives the same state up to rounding.
inline NavState moved_in_time(const ImuHistory& history, const ImuScale& scale, const NavState& x, HostStamp from,
                              HostStamp to) {
  Vec3 rate;
  NavState later = x;
  if (to >= from) {
    history.propagate(from, to, scale, later, rate);
    return later;
  }
  const double T = (from - to).seconds();
  history.propagate(to, from, scale, later, rate);  // of a state that turns from x.R on
  NavState earlier = x;
  earlier.R = x.R * later.R.transpose() * x.R;
  later = earlier;
  history.propagate(to, from, scale, later, rate);
  earlier.v -= later.v - x.v;
  earlier.p -= later.p - x.p + (earlier.v - x.v) * T;
  return earlier;
}

}  // namespace epiline
