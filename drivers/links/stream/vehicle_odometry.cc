#include "drivers/links/stream/vehicle_odometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

using Mat6 = Eigen::Matrix<double, 6, 6>;
using Map16 = Eigen::Matrix<double, 6, 16>;
using Covariance16 = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;

Covariance6 upper_triangle(const Map16& J, const Odometry& o) {
  const Mat6 C = J * Eigen::Map<const Covariance16>(o.covariance.data()) * J.transpose();
  Covariance6 triangle{};
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) triangle[at++] = static_cast<float>(C(i, j));
  const bool known = std::all_of(triangle.begin(), triangle.end(), [](float c) { return std::isfinite(c); });
  if (!known) triangle[0] = std::numeric_limits<float>::quiet_NaN();
  return triangle;
}

/// (position, rotation) in W by the errors of the estimate: R <- R Exp(dtheta) turns by R dtheta in the world.
Covariance6 pose_covariance(const Odometry& o, const Mat3& R_WB) {
  Map16 J = Map16::Zero();
  J.block<3, 3>(0, 0) = Mat3::Identity();
  J.block<3, 3>(3, 3) = R_WB;
  return upper_triangle(J, o);
}

/// (velocity, rates) in V: v_B = R' v changes by [v_B]x dtheta + R' dv, the rate by -db_g.
Covariance6 velocity_covariance(const Odometry& o, const Mat3& R_WB, const Mat3& R_VB) {
  const Mat3 R_BW = R_WB.transpose();
  Map16 J = Map16::Zero();
  J.block<3, 3>(0, 3) = R_VB * skew(R_BW * Vec3(o.v_WB_m_s.data()));
  J.block<3, 3>(0, 6) = R_VB * R_BW;
  J.block<3, 3>(3, 12) = -R_VB;
  return upper_triangle(J, o);
}

/// Of the two quaternions of an attitude, receivers have always got the one that follows from axes x forward, y right,
/// z down: its sign is part of what goes over the wire.
std::array<float, 4> quaternion_of(const Mat3& R_WV) {
  const Mat3 flip = Vec3(1, -1, -1).asDiagonal();  // up to down
  const Mat3 R_down = flip * R_WV * flip;
  const Eigen::Quaternionf q(Eigen::Quaterniond(R_down).normalized().cast<float>());
  return {q.w(), q.x(), -q.y(), -q.z()};
}

}  // namespace

VehicleOdometry in_vehicle_axes(const Odometry& o, const Mat3& R_VB) noexcept {
  const Mat3 R_WB = Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]).toRotationMatrix();
  VehicleOdometry vehicle;
  vehicle.R_WV = R_WB * R_VB.transpose();
  vehicle.q_WV = quaternion_of(vehicle.R_WV);
  vehicle.v_V_m_s = (R_VB * (R_WB.transpose() * Vec3(o.v_WB_m_s.data()))).cast<float>();
  vehicle.omega_V_rad_s = (R_VB * Vec3(o.omega_B_rad_s.data())).cast<float>();
  vehicle.pose_covariance = pose_covariance(o, R_WB);
  vehicle.velocity_covariance = velocity_covariance(o, R_WB, R_VB);
  return vehicle;
}

}  // namespace epiline
