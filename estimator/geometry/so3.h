#pragma once
// SO(3): exponential, logarithm and the right Jacobian. Right perturbation: R <- R Exp(dtheta).
#include "estimator/geometry/types.h"

namespace epiline {

/// [a]x with [a]x b = a x b.
Mat3 skew(const Vec3& a);
/// Exp: rotation vector (rad) to rotation matrix. Exact to rounding for every angle, zero included.
Mat3 so3_exp(const Vec3& theta);
/// Log: inverse of so3_exp with |theta| <= pi; safe at 0 and near pi.
Vec3 so3_log(const Mat3& R);
/// J_r with Exp(theta + d) ~ Exp(theta) Exp(J_r d).
Mat3 so3_right_jacobian(const Vec3& theta);
/// J_r^-1; theta below 2 pi.
Mat3 so3_right_jacobian_inverse(const Vec3& theta);
/// The nearest rotation, for a matrix that drifted from orthonormality by rounding.
Mat3 so3_normalised(const Mat3& R);

}  // namespace epiline
