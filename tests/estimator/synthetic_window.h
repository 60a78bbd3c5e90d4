#pragma once
// A window with known truth: an IMU on a smooth path, points in front of a camera, bearings with noise.
#include <cmath>
#include <memory>
#include <vector>

#include "estimator/factors/imu.h"
#include "estimator/window/window.h"

namespace epiline {

struct SyntheticOptions {
  int frames = 8;
  int tracks = 60;
  double pixel_noise = 0.5;
  double motion = 1;          ///< scales the path; 0: the rig only turns
  double lever = 1;           ///< scales p_BC; with neither motion nor lever there is no parallax at all
  double state_error = 3e-3;  ///< random, added to the states after the window is built
  double time_offset = 0;     ///< the stamps are wrong by this much
  double readout_s = 0;       ///< rolling shutter, of an image of 480 rows
  ImuScale imu_scale = {};    ///< true readings over measured ones, less 1
  bool second = false;        ///< a second camera, turned and 0.11 m beside the first one, sees three of four tracks,
                              ///< which have ages then, and were found by it at other ages
  int found_anew = 0;         ///< from this frame on the second camera has found each track anew
  double second_later = 0;    ///< s: the second camera exposes so much after the first one
  bool alone = false;       ///< with `second`: of every fourth track the first camera sees nothing, the second one all
  bool only_alone = false;  ///< no other tracks than those
  bool fisheye = false;     ///< the first camera's pixels are as far from the centre as the angle is large
  bool moved = false;       ///< instead of `second`: the one camera is where the second one would be
  unsigned seed = 1;
};

inline constexpr double kFocal = 458;

/// Smooth path in W and its derivatives.
struct SyntheticPath {
  double motion;
  Vec3 p(double t) const {
    return motion * Vec3(1.3 * std::sin(0.9 * t), 0.8 * std::cos(1.1 * t), 0.4 * std::sin(1.7 * t));
  }
  Vec3 v(double t) const {
    return motion * Vec3(1.17 * std::cos(0.9 * t), -0.88 * std::sin(1.1 * t), 0.68 * std::cos(1.7 * t));
  }
  Vec3 a(double t) const {
    return motion * Vec3(-1.053 * std::sin(0.9 * t), -0.968 * std::cos(1.1 * t), -1.156 * std::sin(1.7 * t));
  }
  Mat3 R(double t) const {
    return so3_exp(Vec3(0, 0, 0.5 * t)) * so3_exp(Vec3(0.1 * std::sin(1.3 * t), 0.15 * std::sin(t), 0));
  }
  Vec3 w(double t) const {
    const double h = 1e-6;
    return so3_log(R(t - h).transpose() * R(t + h)) / (2 * h);
  }
};

inline TrackedFeature make_feature(std::uint32_t id, const Vec3& p_C, const Vec2& noise_px) {
  TrackedFeature f;
  f.id = id;
  const Vec2 z = p_C.head<2>() / p_C.z() + noise_px / kFocal;
  const Vec3 b = Vec3(z.x(), z.y(), 1).normalized();
  f.bearing = {b.x(), b.y(), b.z()};
  const double k = kFocal / b.z();
  f.pixel_jacobian = {k, 0, -k * z.x(), 0, k, -k * z.y()};
  return f;
}

/// The same bearing by a fisheye.
inline void through_fisheye(TrackedFeature& f) {
  const double x = f.bearing[0], y = f.bearing[1], z = f.bearing[2], sine = std::hypot(x, y);
  const Vec3 along(z * x / sine, z * y / sine, -sine), across(-y / sine, x / sine, 0);
  const double a = kFocal / sine, b = kFocal * std::acos(z) / (sine * sine);
  for (int i = 0; i < 3; ++i) {
    f.pixel_jacobian[static_cast<std::size_t>(i)] = a * x * along[i] - b * y * across[i];
    f.pixel_jacobian[static_cast<std::size_t>(i + 3)] = a * y * along[i] + b * x * across[i];
  }
}

inline Calibration synthetic_calibration(double lever = 1) {
  Calibration c;
  c.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  c.p_BC = lever * Vec3(0.06, 0.02, -0.01);
  return c;
}

inline Rig synthetic_rig() {
  Rig rig;
  rig.use[1] = true;
  rig.poses[1] = {so3_exp(Vec3(0.02, -0.03, 0.01)), Vec3(0.11, 0.004, -0.006)};
  return rig;
}

inline SecondView make_second_view(std::uint32_t id, const Vec3& p_D, const Vec2& noise_px, std::uint32_t age = 0,
                                   std::uint32_t found = 0) {
  const TrackedFeature f = make_feature(id, p_D, noise_px);
  return {.id = id, .age = age, .found = found, .bearing = f.bearing, .pixel_jacobian = f.pixel_jacobian};
}

struct SyntheticWindow {
  std::unique_ptr<Window> window;
  std::vector<NavState> truth;
};

SyntheticWindow make_window(const SyntheticOptions& o);

}  // namespace epiline
