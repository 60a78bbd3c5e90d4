// A simulated robot rests for a second, then swings from side to side in front of a wall of points. Each second the
// program prints the true and the estimated position. Replace samples and points by those of your IMU and tracker.
#include <cmath>
#include <cstdio>

#include "estimator/estimator.h"
#include "estimator/geometry/tracked_feature.h"

using namespace epiline;

constexpr HostStamp at(int milliseconds) { return {milliseconds * 1'000'000LL}; }

/// Position to the left, m, and its second derivative.
double left(double t) { return t < 1 ? 0 : 0.5 * std::pow(std::sin(t - 1), 2); }
double acceleration(double t) { return t < 1 ? 0 : std::cos(2 * (t - 1)); }

/// What a camera at `y` sees of 10 x 6 points on a wall 3 m ahead. With a real tracker, raw pixels and ids come from
/// it.
TrackedFrame tracks(const Camera& camera, const Mat3& R_BC, double y) {
  TrackedFrame frame;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const Vec3 point_C = R_BC.transpose() * Vec3(3, 0.25 * (i % 10) - 1.1 - y, 0.3 * (i / 10) - 0.8);
    TrackedFeature feature;
    feature.id = i;
    Vec2 pixel;
    if (camera.project(point_C, pixel) && set_pixel(camera, pixel, feature)) frame.features.push_back(feature);
  }
  return frame;
}

int main() {
  const Camera camera({.width = 640, .height = 480, .intrinsics = {400, 400, 320, 240}});
  EstimatorConfig config;
  config.extrinsics.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // the camera looks along the body's x axis; y points left
  config.extrinsics.focal_px = camera.focal_px();
  Estimator estimator(config);
  Supervisor supervisor;  // the default: no limit of the effort

  double error = 1;
  for (int ms = 0; ms <= 10'000; ms += 5) {
    const double t = 1e-3 * ms;
    estimator.add_imu({.stamp = at(ms), .specific_force_m_s2 = {0, acceleration(t), 9.81}});
    if (ms % 50 != 0) continue;
    TrackedFrame frame = tracks(camera, config.extrinsics.R_BC, left(t));
    frame.stamp = at(ms);
    if (!estimator.process(frame, supervisor).has_pose || ms % 1000 != 0) continue;
    const Odometry& o = estimator.odometry();
    error = std::hypot(o.p_WB_m[0], o.p_WB_m[1] - left(t), o.p_WB_m[2]);
    std::printf("%4.1f s: %.3f m to the left, true %.3f m, sigma %.3f m, %s\n", t, o.p_WB_m[1], left(t),
                std::sqrt(o.covariance[17]), o.health.state == HealthState::kTracking ? "tracking" : "not tracking");
  }
  return error < 0.05 ? 0 : 1;
}
