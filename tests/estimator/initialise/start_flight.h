#pragma once
// A made-up flight with exact poses, IMU readings and bearings, for the tests of the start.
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "estimator/geometry/so3.h"
#include "estimator/initialise/start_problem.h"

namespace epiline::test {

/// Pose in a world with z up.
struct StartMotion {
  std::function<Vec3(double)> p;  ///< m
  std::function<Mat3(double)> R;
};

inline StartMotion wandering(unsigned seed) {
  std::mt19937 g(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  std::array<Vec3, 3> a, b;
  for (int n = 0; n < 3; ++n) {
    a[n] = Vec3(u(g), u(g), 0.6 * u(g)) * 0.35;
    b[n] = Vec3(u(g), u(g), u(g)) * 0.15;
  }
  const auto sum = [](const std::array<Vec3, 3>& c, double t) {
    return Vec3(c[0] * std::sin(1.1 * t + 0.4) + c[1] * std::sin(2.3 * t + 1.7) + c[2] * std::sin(3.7 * t + 2.9));
  };
  const Mat3 R0 = so3_exp(Vec3(0.3 * u(g), 0.3 * u(g), 3 * u(g)));
  return {[=](double t) { return sum(a, t); }, [=](double t) { return Mat3(R0 * so3_exp(sum(b, t))); }};
}

inline StartMotion constant_velocity(const Vec3& v) {
  return {[=](double t) { return Vec3(v * t); }, [](double) { return Mat3(so3_exp(Vec3(0.1, -0.2, 0.5))); }};
}

struct FlightSettings {
  int frames = 11;
  double interval_s = 0.05;
  int imu_per_interval = 50;
  int points = 100;
  double noise_rad = 0, outliers = 0;  ///< outliers: share of bearings thrown up to 0.05 rad off
  Vec3 b_g = Vec3::Zero(), b_a = Vec3::Zero();
  Vec3 b_g_ref = Vec3::Zero();
  unsigned seed = 1;
};

/// A start problem together with its truth. Its data lie in the vectors, so it is moved and never copied.
struct StartFlight {
  StartFlight() = default;
  StartFlight(StartFlight&&) = default;

  std::vector<Preintegration> interval;
  std::vector<StartTrack> tracks;
  StartProblem problem;
  StartState truth;
  std::vector<Vec3> p;  ///< in B_0
  std::vector<Mat3> R;
};

inline Vec3 rate(const StartMotion& m, double t) {
  constexpr double h = 1e-4;
  return so3_log(m.R(t - h).transpose() * m.R(t + h)) / (2 * h);
}
inline Vec3 velocity(const StartMotion& m, double t) {
  constexpr double h = 1e-4;
  return (8 * (m.p(t + h) - m.p(t - h)) - (m.p(t + 2 * h) - m.p(t - 2 * h))) / (12 * h);
}
inline Vec3 specific_force(const StartMotion& m, double t) {
  constexpr double h = 1e-3;
  const Vec3 a = (16 * (m.p(t + h) + m.p(t - h)) - (m.p(t + 2 * h) + m.p(t - 2 * h)) - 30 * m.p(t)) / (12 * h * h);
  return m.R(t).transpose() * (a + Vec3(0, 0, kGravity));
}

inline void add_intervals(const StartMotion& m, const FlightSettings& s, StartFlight& f) {
  const double dt = s.interval_s / s.imu_per_interval;
  const ImuNoise noise;
  for (int k = 0; k + 1 < s.frames; ++k) {
    Preintegration pre;
    pre.reset(Vec3::Zero(), s.b_g_ref);
    for (int n = 0; n < s.imu_per_interval; ++n) {
      const double t = k * s.interval_s + n * dt;
      pre.integrate(rate(m, t) + s.b_g, specific_force(m, t) + s.b_a, rate(m, t + dt) + s.b_g,
                    specific_force(m, t + dt) + s.b_a, dt, noise);
    }
    f.interval.push_back(pre);
  }
}

/// Each point is seen from a random first to a random last frame.
inline void add_tracks(const StartMotion& m, const FlightSettings& s, StartFlight& f) {
  std::mt19937 g(s.seed + 1000);
  std::uniform_real_distribution<double> u(-1, 1);
  std::normal_distribution<double> normal;
  for (int n = 0; n < s.points; ++n) {
    const Vec3 d(0.7 * u(g), 0.45 * u(g), 1);
    const double depth = 4.5 + 3 * u(g);
    const Mat3 R_WC = m.R(0) * f.problem.R_BC;
    const Vec3 point = m.p(0) + m.R(0) * f.problem.p_BC + R_WC * (d * depth);
    const int first = n % 3 == 0 ? static_cast<int>(0.4 * (1 + u(g)) * s.frames) : 0;
    const int last = n % 3 == 1 ? s.frames - 1 - static_cast<int>(0.4 * (1 + u(g)) * s.frames) : s.frames - 1;
    StartTrack t;
    for (int k = first; k <= last; ++k) {
      const double time = k * s.interval_s;
      const Mat3 R = m.R(time) * f.problem.R_BC;
      Vec3 v = (R.transpose() * (point - m.p(time) - m.R(time) * f.problem.p_BC)).normalized();
      const double size = u(g) * 0.5 + 0.5 < s.outliers ? 0.05 : s.noise_rad;
      v = so3_exp(size * Vec3(normal(g), normal(g), normal(g))) * v;
      t.frame[t.count] = static_cast<std::uint8_t>(k);
      t.f_C[t.count++] = v;
    }
    if (t.count >= 2) f.tracks.push_back(t);
  }
}

inline StartFlight fly(const StartMotion& m, const FlightSettings& s) {
  StartFlight f;
  f.problem.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  f.problem.p_BC = Vec3(0.06, -0.02, 0.03);
  add_intervals(m, s, f);
  add_tracks(m, s, f);
  f.problem.frames = s.frames;
  f.problem.interval = f.interval.data();
  f.problem.tracks = f.tracks;
  f.problem.sigma_rad = std::max(s.noise_rad, 1e-5);
  f.problem.b_g_ref = s.b_g_ref;
  f.truth = {m.R(0).transpose() * velocity(m, 0), m.R(0).transpose() * Vec3(0, 0, -kGravity), s.b_g, s.b_a};
  for (int k = 0; k < s.frames; ++k) {
    const double t = k * s.interval_s;
    f.p.push_back(m.R(0).transpose() * (m.p(t) - m.p(0)));
    f.R.push_back(m.R(0).transpose() * m.R(t));
  }
  return f;
}
/// With points, too, of that seed.
inline StartFlight wander(unsigned seed, FlightSettings s = {}) {
  s.seed = seed;
  return fly(wandering(seed), s);
}

}  // namespace epiline::test
