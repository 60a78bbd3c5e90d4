#pragma once
#include "estimator/geometry/so3.h"
#include "estimator/geometry/types.h"

namespace epiline {

inline const Vec3 kGravity_W(0, 0, -9.81);  ///< m/s^2

/// State of one frame: the IMU body B in the world W. Tangent order (p, theta, v, b_a, b_g), rotation perturbed on the
/// right.
struct NavState {
  Vec3 p = Vec3::Zero(), v = Vec3::Zero(), b_a = Vec3::Zero(), b_g = Vec3::Zero();
  Mat3 R = Mat3::Identity();
};

/// Covariance of a state and the camera's time offset: order dp, dtheta, dv, dba, dbg, dtd.
using StateCovariance = Eigen::Matrix<double, 16, 16>;

/// Pose part of x [+] delta.
inline void retract_pose(NavState& x, const Vec6& d) {
  x.p += d.head<3>();
  x.R = x.R * so3_exp(d.tail<3>());
}
/// Velocity and biases of x [+] delta.
inline void retract_velocity_biases(NavState& x, const Vec9& d) {
  x.v += d.head<3>();
  x.b_a += d.segment<3>(3);
  x.b_g += d.tail<3>();
}
/// Pose part of x [-] x0.
inline Vec6 local_pose(const NavState& x0, const NavState& x) {
  Vec6 d;
  d << x.p - x0.p, so3_log(x0.R.transpose() * x.R);
  return d;
}
inline Vec9 local_velocity_biases(const NavState& x0, const NavState& x) {
  Vec9 d;
  d << x.v - x0.v, x.b_a - x0.b_a, x.b_g - x0.b_g;
  return d;
}

}  // namespace epiline
