#pragma once
// IMU preintegration on the manifold (Forster et al. 2017; midpoint rule). Derivation: docs/derivations/imu.md.
#include "estimator/geometry/types.h"
#include "estimator/inertial/imu_noise.h"
#include "estimator/inertial/imu_scale.h"

namespace epiline {

using ScaleColumns = Eigen::Matrix<double, 9, 2>;  ///< of (p, theta, v) by (s_a, s_g)

/// One IMU interval. Tangent order everywhere: (p, theta, v, b_a, b_g).
struct Preintegration {
  double T = 0;              ///< length, s
  bool knows_motion = true;  ///< false: too long, so that only the biases at its ends are related
  Vec3 dp = Vec3::Zero();    ///< Delta p, in the body frame at the start
  Vec3 dv = Vec3::Zero();
  Mat3 dR = Mat3::Identity();
  Vec3 b_a = Vec3::Zero(), b_g = Vec3::Zero();  ///< the linearisation point
  ImuScale scale;                               ///< the same
  Mat15 J = Mat15::Identity();                  ///< d(state at the end) / d(state at the start)
  Mat15 C = Mat15::Zero();                      ///< covariance, bias walk included
  /// d(p, theta, v at the end) / d s_g
  Vec9 J_s_g = Vec9::Zero();

  void reset(const Vec3& b_a_hat, const Vec3& b_g_hat, const ImuScale& scale_hat = {});
  /// One midpoint step of `dt` seconds between the readings (w0, a0) and (w1, a1).
  void integrate(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt, const ImuNoise& noise);
  /// d(p, theta, v at the end) / d(s_a, s_g), the rotation perturbed on the right.
  ScaleColumns by_scale() const;
  /// Delta p, v, R moved to other biases and scales by the first-order Jacobians.
  void corrected(const Vec3& b_a_new, const Vec3& b_g_new, const ImuScale& scale_new, Vec3& p, Vec3& v, Mat3& R) const;
  /// Appends the interval that follows this one, in closed form (docs/derivations/imu.md).
  void join(const Preintegration& next);
  /// Adds a constant acceleration that the readings do not show, of this standard deviation (m/s^2); if there is one,
  /// the accelerometer's bias may have stepped, a little, at the end.
  void doubt_forces(double acceleration);
  /// The gyroscope's bias has stepped by this standard deviation (rad/s), at the beginning or at the end.
  void doubt_rates(double step);
  /// The forces are unknown: the velocity stays as it is but for `acceleration` (m/s^2) for as long as the interval
  /// lasts. Rotation and biases go on as integrated.
  void forget_forces(double acceleration);
  /// From here on the interval says nothing of the motion, only of how far the biases walk.
  void forget_motion() { knows_motion = false; }
};

/// An interval while readings are added to it. It is complete again when this ends, so a function must not return the
/// interval before. Errors of the attitude are in the axes of the body at the beginning meanwhile, which a step does
/// not turn (docs/derivations/imu.md, "One step").
class Integration {
 public:
  explicit Integration(Preintegration& interval) noexcept;
  ~Integration();
  Integration(const Integration&) = delete;
  Integration& operator=(const Integration&) = delete;
  /// As Preintegration::integrate().
  void step(const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt, const ImuNoise& noise) noexcept;

 private:
  /// What a step adds to velocity and attitude: v' = v + d, d = [turn]x theta + by_a b_a + by_g b_g, and
  /// theta' = theta - N b_g.
  struct Step {
    double dt;
    Vec3 turn;
    Mat3 by_a, by_g, N;
  };
  /// Derivatives at the end by the biases at the beginning.
  struct ByBiases {
    Mat3 p_a, p_g, theta_g, v_a, v_g;
  };
  /// Blocks of the covariance. The biases know nothing of each other, the accelerometer's bias nothing of the attitude,
  /// and their own blocks are a and g times one.
  struct Covariance {
    Mat3 pp, pt, pv, pa, pg, tt, tg, vt, vv, va, vg;
    double a, g;
  };
  void move_derivatives(const Step& s, const Vec3& by_s) noexcept;
  void move_covariance(const Step& s) noexcept;
  void add_noise(double dt, const ImuNoise& noise) noexcept;

  Preintegration& z_;
  ByBiases J_;
  Covariance C_;
};

}  // namespace epiline
