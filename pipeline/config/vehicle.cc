#include "pipeline/config/vehicle.h"

#include <Eigen/Geometry>
#include <numbers>

namespace epiline {

Mat3 R_VB_of(const BodyConfig& body) {
  constexpr double kDegree = std::numbers::pi / 180;
  return (Eigen::AngleAxisd(body.yaw_deg * kDegree, Vec3::UnitZ()) *
          Eigen::AngleAxisd(body.pitch_deg * kDegree, Vec3::UnitY()) *
          Eigen::AngleAxisd(body.roll_deg * kDegree, Vec3::UnitX()))
      .toRotationMatrix();
}

void set_vehicle(WheelModel& wheel, const WheelConfig& config, const Mat3& R_VB) {
  wheel.forward_B = R_VB.transpose() * Vec3::UnitX();
  wheel.p_BV = R_VB.transpose() * Vec3(config.x_m, config.y_m, config.z_m);
}

}  // namespace epiline
