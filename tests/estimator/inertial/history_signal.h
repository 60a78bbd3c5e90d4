#pragma once
// A smooth signal of an IMU, and histories of its readings.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "estimator/geometry/so3.h"
#include "estimator/inertial/imu_history.h"
#include "tests/estimator/made_up_time.h"

namespace epiline::test {

inline Vec3 rate(double t) { return {0.3 * std::sin(2 * t), 0.5 * std::cos(t), -0.2 + 0.1 * t}; }
inline Vec3 force(double t) { return {std::sin(3 * t), 2 * std::cos(2 * t), 9.8 + 0.3 * std::sin(t)}; }

inline ImuSample sample(double t) {
  ImuSample s;
  s.stamp = at(t);
  Eigen::Map<Vec3>(s.angular_velocity_rad_s.data()) = rate(t);
  Eigen::Map<Vec3>(s.specific_force_m_s2.data()) = force(t);
  return s;
}

inline std::unique_ptr<ImuHistory> history(double from, double to, double dt = 0.005) {
  auto h = std::make_unique<ImuHistory>();
  for (int i = 0; from + i * dt <= to + 1e-9; ++i) h->push(sample(from + i * dt));
  return h;
}

inline const Vec3 kBa(0.1, -0.05, 0.02), kBg(0.01, 0.02, -0.01);

inline Preintegration integrated(const ImuHistory& h, double t0, double t1) {
  Preintegration z;
  z.reset(kBa, kBg);
  EXPECT_TRUE(h.integrate(at(t0), at(t1), {}, z));
  return z;
}

inline double difference(const Preintegration& a, const Preintegration& b) {
  return (a.dp - b.dp).norm() + (a.dv - b.dv).norm() + so3_log(a.dR.transpose() * b.dR).norm() + std::abs(a.T - b.T);
}

}  // namespace epiline::test
