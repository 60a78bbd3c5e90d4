#include "pipeline/config/vehicle.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace epiline {

namespace {
constexpr double kDegree = std::numbers::pi / 180;
}

Mat3 R_VB_of(const BodyConfig& body) {
  return (Eigen::AngleAxisd(body.yaw_deg * kDegree, Vec3::UnitZ()) *
          Eigen::AngleAxisd(body.pitch_deg * kDegree, Vec3::UnitY()) *
          Eigen::AngleAxisd(body.roll_deg * kDegree, Vec3::UnitX()))
      .toRotationMatrix();
}

void set_vehicle(Config& config) {
  const DevicesConfig& d = config.devices;
  const Mat3 R_BV = R_VB_of(d.body).transpose();
  WheelModel& wheel = config.estimator.wheel;
  wheel.forward_B = R_BV * Vec3::UnitX();
  wheel.p_BV = R_BV * Vec3(d.wheel.x_m, d.wheel.y_m, d.wheel.z_m);
  HeightModel& range = config.estimator.heights[static_cast<std::size_t>(HeightKind::kRangeFinder)];
  range.p_BS = R_BV * Vec3(d.height.range_x_m, d.height.range_y_m, d.height.range_z_m);
  const Vec3 beam_V(std::tan(d.height.range_forward_deg * kDegree), std::tan(d.height.range_left_deg * kDegree), -1);
  range.beam_B = R_BV * beam_V.normalized();
}

}  // namespace epiline
