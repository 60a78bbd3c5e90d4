#pragma once
// States and readings for tests of the predictor.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "estimator/geometry/so3.h"
#include "estimator/predict/predictor.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/inertial/random_interval.h"
#include "tests/estimator/made_up_time.h"

namespace epiline::test {

using Mat16 = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
using Vec16 = Eigen::Matrix<double, 16, 1>;

inline ImuSample sample(HostStamp t, const Vec3& w, const Vec3& a) {
  return {t, {w.x(), w.y(), w.z()}, {a.x(), a.y(), a.z()}};
}

/// What the estimator would publish for the state `x` at the IMU's time `t`: its pose and velocity moved back to the
/// image's stamp. `acceleration`: in W, about `t`.
inline Odometry solved(const NavState& x, HostStamp t, const Vec3& omega, const Mat16& P = Mat16::Identity(),
                       double time_offset = 0, const Vec3& acceleration = Vec3::Zero()) {
  Odometry o;
  o.time_offset_s = time_offset;
  o.stamp = t - Span::from_seconds(time_offset);
  const double dt = (o.stamp - t).seconds();
  const Eigen::Quaterniond q(x.R * so3_exp(omega * dt));
  Eigen::Map<Vec3>(o.p_WB_m.data()) = x.p + x.v * dt;
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Vec3>(o.v_WB_m_s.data()) = x.v + acceleration * dt;
  Eigen::Map<Vec3>(o.omega_B_rad_s.data()) = omega;
  Eigen::Map<Vec3>(o.accelerometer_bias_m_s2.data()) = x.b_a;
  Eigen::Map<Vec3>(o.gyroscope_bias_rad_s.data()) = x.b_g;
  Eigen::Map<Mat16>(o.covariance.data()) = P;
  o.reset_counter = 3;
  o.health = {HealthState::kTracking, 0, 90};
  return o;
}

inline NavState state_of(const Odometry& o) {
  NavState x;
  x.p = Vec3(o.p_WB_m.data());
  x.v = Vec3(o.v_WB_m_s.data());
  x.R = Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]).toRotationMatrix();
  x.b_a = Vec3(o.accelerometer_bias_m_s2.data());
  x.b_g = Vec3(o.gyroscope_bias_rad_s.data());
  return x;
}

inline Mat16 covariance_of(const Odometry& o) { return Eigen::Map<const Mat16>(o.covariance.data()); }

inline Vec15 difference(const NavState& from, const NavState& to) {
  Vec15 d;
  d << local_pose(from, to), local_velocity_biases(from, to);
  return d;
}

inline NavState some_state(Random& random) {
  NavState x;
  x.p = random.gaussian(3);
  x.v = random.gaussian(1);
  x.b_a = random.gaussian(0.1);
  x.b_g = random.gaussian(0.02);
  x.R = so3_exp(random.gaussian(1));
  return x;
}

/// A full covariance, nothing uncorrelated, with about these standard deviations.
inline Mat16 some_covariance(Random& random, double p, double theta, double v, double b_a, double b_g) {
  const double sigma[] = {p, theta, v, b_a, b_g, 1e-3};
  Eigen::MatrixXd A(16, 16);
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) A(i, j) = sigma[i / 3] * ((i == j) + 0.2 * random.gaussian(1).x());
  return product(A, A.transpose());
}

inline PredictorConfig noisy() {
  PredictorConfig c;
  c.density.noise = {.gyroscope_density = 2e-3,
                     .gyroscope_random_walk = 2e-2,
                     .accelerometer_density = 2e-2,
                     .accelerometer_random_walk = 3e-1};
  return c;
}

inline PredictorConfig without_blending(PredictorConfig c) {
  c.blend_s = 0;
  return c;
}

inline void feed(Predictor& predictor, const Readings& s, int from, int to) {
  for (int k = from; k < to; ++k)
    ASSERT_EQ(predictor.add_imu(sample(at(k * s.dt), s.w[k], s.a[k])), ImuHistory::Push::kTaken);
}

}  // namespace epiline::test
