#include "pipeline/config/vehicle.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace epiline {

namespace {
constexpr double kDegree = std::numbers::pi / 180;
}

Mat3 R_VB_of(const BodyConfig& body) {
  const auto& [yaw, pitch, roll] = body.yaw_pitch_roll_deg;
  return (Eigen::AngleAxisd(yaw * kDegree, Vec3::UnitZ()) * Eigen::AngleAxisd(pitch * kDegree, Vec3::UnitY()) *
          Eigen::AngleAxisd(roll * kDegree, Vec3::UnitX()))
      .toRotationMatrix();
}

void set_vehicle(Config& config) {
  const DevicesConfig& d = config.devices;
  const Mat3 R_BV = R_VB_of(d.body).transpose();
  WheelModel& wheel = config.estimator.wheel;
  wheel.forward_B = R_BV * Vec3::UnitX();
  wheel.p_BV = R_BV * Vec3(d.wheel.position_m.data());
  HeightModel& range = config.estimator.heights[static_cast<std::size_t>(HeightKind::kRangeFinder)];
  range.p_BS = R_BV * Vec3(d.height.range_position_m.data());
  const auto& [forward_deg, left_deg] = d.height.range_tilt_deg;
  const Vec3 beam_V(std::tan(forward_deg * kDegree), std::tan(left_deg * kDegree), -1);
  range.beam_B = R_BV * beam_V.normalized();
}

}  // namespace epiline
