#pragma once
#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/scalar_history.h"

namespace epiline {

/// The way of a vehicle's point between two frames, as its wheels read it, in the body frame at the first of them.
/// Derivation: docs/derivations/wheel.md; test: tests/estimator/inertial/wheel_way_test.cc.
struct WheelWay {
  bool known = false;
  bool slips = false;  ///< another scale than the next way's: slip has begun or ended
  bool mixed = false;  ///< joined from two scales: unknown for good
  // As the window last found them, before its solve.
  double scale = 1;            ///< of the speeds read over true ones
  double moved = 0;            ///< way along the mean axis, m
  Vec3 way = Vec3::Zero();     ///< integral of the speed along the forward axis, m
  Vec3 axis_s = Vec3::Zero();  ///< integral of that axis, s
  double time_of_one_s2 = 0;   ///< integral of the time between speeds: variance of the way where theirs is 1

  /// Appends the way that follows. `dR`: the body's turn during this one.
  void join(const Mat3& dR, const WheelWay& next) noexcept;
};

/// False, and `out` is as it was: there are no speeds around all of the time from t0 to t1.
bool integrate_way(const ScalarHistory& speeds, const ImuHistory& imu, HostStamp t0, HostStamp t1,
                   const Vec3& forward_B, const Vec3& b_g, const ImuScale& scale, WheelWay& out) noexcept;

}  // namespace epiline
