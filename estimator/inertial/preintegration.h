#pragma once
// IMU preintegration on the manifold (Forster et al. 2017; midpoint rule). Derivation: docs/derivations/imu.md.
#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_noise.h"

namespace epiline {

/// One IMU interval. Tangent order everywhere: (p, theta, v, b_a, b_g).
struct Preintegration {
  double T = 0;            ///< length, s
  Vec3 dp = Vec3::Zero();  ///< Delta p, in the body frame at the start
  Vec3 dv = Vec3::Zero();
  Mat3 dR = Mat3::Identity();
  Vec3 b_a = Vec3::Zero(), b_g = Vec3::Zero();  ///< the linearisation point
  Mat15 J = Mat15::Identity();                  ///< d(state at the end) / d(state at the start)
  Mat15 C = Mat15::Zero();                      ///< covariance, bias walk included

  void reset(const Vec3& b_a_hat, const Vec3& b_g_hat);
  /// One midpoint step of `dt` seconds between the readings (w0, a0) and (w1, a1).
  void integrate(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt, const ImuNoise& noise);
  /// Delta p, v, R moved to other biases by the first-order Jacobians.
  void corrected(const Vec3& b_a_new, const Vec3& b_g_new, Vec3& p, Vec3& v, Mat3& R) const;
  /// Appends the interval that follows this one, in closed form (docs/derivations/imu.md).
  void join(const Preintegration& next);
};

}  // namespace epiline
