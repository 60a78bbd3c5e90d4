#pragma once
// Random IMU readings for tests, and an integrator of them that shares no code with the product.
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <random>

#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"

namespace epiline::test {

/// Up to 64 readings, `dt` apart.
struct Readings {
  int count = 0;
  double dt = 0.005;
  std::array<Vec3, 64> w, a;
};

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  Vec3 gaussian(double sigma) { return {sigma * normal_(engine_), sigma * normal_(engine_), sigma * normal_(engine_)}; }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(engine_); }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

inline NavState random_state(Random& random) {
  NavState x;
  x.p = random.gaussian(5);
  x.v = random.gaussian(2);
  x.b_a = random.gaussian(0.1);
  x.b_g = random.gaussian(0.05);
  x.R = so3_exp(random.gaussian(1.5));
  return x;
}

/// x [+] d.
inline NavState displaced(NavState x, const Vec15& d) {
  retract_pose(x, d.head<6>());
  retract_velocity_biases(x, d.tail<9>());
  return x;
}

/// Readings of an agile flight: smooth rates of some rad/s, specific force around 1 g, one phase per axis.
inline Readings agile_readings(int count, double dt, Random& random) {
  Readings s;
  s.count = count;
  s.dt = dt;
  const Vec3 w0 = random.gaussian(1.5), w1 = random.gaussian(1.5), a0 = Vec3(0, 0, 9.81) + random.gaussian(4),
             a1 = random.gaussian(4);
  const double omega = random.uniform(2, 20), phase = random.uniform(0, 6.28);
  for (int k = 0; k < count; ++k) {
    const double c = std::sin(omega * k * dt + phase);
    s.w[k] = w0 + c * w1;
    s.a[k] = a0 + c * a1;
  }
  return s;
}

inline void integrate(const Readings& s, int from, int to, const ImuNoise& noise, Preintegration& interval) {
  for (int k = from; k < to; ++k) interval.integrate(s.w[k], s.a[k], s.w[k + 1], s.a[k + 1], s.dt, noise);
}

inline Preintegration integrated(const Readings& s, const Vec3& b_a, const Vec3& b_g, const ImuNoise& noise,
                                 const ImuScale& scale = {}) {
  Preintegration interval;
  interval.reset(b_a, b_g, scale);
  integrate(s, 0, s.count - 1, noise, interval);
  return interval;
}

/// Position, velocity and attitude in the first body frame.
struct Motion {
  Vec3 p = Vec3::Zero(), v = Vec3::Zero();
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
};

/// One midpoint step with quaternions.
inline void step(Motion& m, const Vec3& w0, const Vec3& a0, const Vec3& w1, const Vec3& a1, double dt) {
  const Vec3 w = 0.5 * (w0 + w1);
  const Eigen::Quaterniond q1 = m.q * Eigen::Quaterniond(Eigen::AngleAxisd(w.norm() * dt, w.stableNormalized()));
  const Vec3 a = 0.5 * (m.q * a0 + q1 * a1);
  m.p += m.v * dt + 0.5 * a * dt * dt;
  m.v += a * dt;
  m.q = q1;
}

}  // namespace epiline::test
