// Stands still in front of a wall of points for two seconds, and says where it is: as MAVLink, if all is well. Then
// asks for outputs that are not there.
#include <Eigen/Core>
#include <cmath>
#include <cstdio>

#include "drivers/links/can/can_output.h"
#include "drivers/links/mavlink/link.h"
#include "drivers/links/mavlink/odometry.h"
#include "drivers/links/mavlink/packet.h"
#include "estimator/estimator.h"
#include "estimator/geometry/tracked_feature.h"

using namespace epiline;

namespace {

TrackedFrame wall(const Camera& camera, std::int64_t time_ns, std::uint64_t sequence) {
  TrackedFrame frame;
  frame.stamp = {time_ns};
  frame.sequence = sequence;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const Vec2 pixel(50.0 + 60.0 * (i % 10), 50.0 + 70.0 * (i / 10));
    TrackedFeature feature;
    feature.id = i;
    feature.age = static_cast<std::uint32_t>(sequence);
    if (set_pixel(camera, pixel, feature)) frame.features.push_back(feature);
  }
  return frame;
}

bool finds_outputs_that_are_not_there() {
  mavlink::MavlinkLink link(MavlinkConfig{}, Mat3::Identity());
  CanOutput bus({.interface = "none"}, Mat3::Identity());
  return link.open() || bus.open();
}

}  // namespace

int main() {
  EstimatorConfig config;
  config.extrinsics.R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // looks along x
  const Camera camera({.width = 640, .height = 480, .intrinsics = {400, 400, 320, 240}});
  config.extrinsics.focal_px = camera.focal_px();
  Estimator estimator(config);
  Supervisor supervisor;
  constexpr std::int64_t kMs = 1'000'000;
  for (std::int64_t t = 0; t <= 2000; t += 5) {
    estimator.add_imu({.stamp = {t * kMs}, .specific_force_m_s2 = {0, 0, 9.81}});
    if (t >= 100 && t % 50 == 0)
      estimator.process(wall(camera, (t - 5) * kMs, static_cast<std::uint64_t>(t / 50 - 2)), supervisor);
  }
  const Odometry& odometry = estimator.odometry();
  const double distance = std::hypot(odometry.p_WB_m[0], odometry.p_WB_m[1], odometry.p_WB_m[2]);
  const mavlink::FrameBytes frame =
      frame_of(pack(mavlink::odometry_message(odometry, Mat3::Identity()), mavlink::Address{}, 0));
  std::printf("%s after %zu bytes of MAVLink: %.4f m from the start\n",
              odometry.health.state == HealthState::kTracking ? "tracking" : "not tracking", frame.bytes().size(),
              distance);
  if (finds_outputs_that_are_not_there()) return 1;
  return odometry.health.state == HealthState::kTracking && distance < 0.01 ? 0 : 1;
}
