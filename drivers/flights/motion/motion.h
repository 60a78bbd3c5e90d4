#pragma once
// The motion of a body as a function of time, for rendering and for simulating an IMU.
#include "estimator/geometry/types.h"
#include "estimator/inertial/nav_state.h"

namespace epiline {

/// State of the body at one time.
struct Motion {
  Vec3 p_WB, v_WB, a_WB;  ///< m, m/s, m/s^2
  Mat3 R_WB;
  Vec3 omega_B;                                                                     ///< rad/s
  Vec3 specific_force_B() const { return R_WB.transpose() * (a_WB - kGravity_W); }  ///< m/s^2
};

/// A motion that is smooth in time: positions twice, rotations once continuously differentiable.
class MotionModel {
 public:
  virtual ~MotionModel() = default;
  /// `t_s` in [0, duration_s()].
  virtual Motion at(double t_s) const = 0;
  virtual double duration_s() const = 0;
};

}  // namespace epiline
