#include "drivers/links/mavlink/odometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/geometry/so3.h"

namespace epiline::mavlink {

namespace {

using Mat6 = Eigen::Matrix<double, 6, 6>;
using Map16 = Eigen::Matrix<double, 6, 16>;
using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;

/// Up to down: y and z negated. Its own inverse.
Mat3 flip() { return Vec3(1, -1, -1).asDiagonal(); }

Mat3 R_WB_of(const epiline::Odometry& o) {
  return Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]).toRotationMatrix();
}

std::array<float, 21> upper_triangle(const Map16& J, const epiline::Odometry& o) {
  const Mat6 C = J * Eigen::Map<const Covariance>(o.covariance.data()) * J.transpose();
  std::array<float, 21> triangle{};
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) triangle[at++] = static_cast<float>(C(i, j));
  const bool known = std::all_of(triangle.begin(), triangle.end(), [](float c) { return std::isfinite(c); });
  if (!known) triangle[0] = std::numeric_limits<float>::quiet_NaN();
  return triangle;
}

/// (position, rotation) in L by the errors of the estimate: R <- R Exp(dtheta) turns by R dtheta in the world.
std::array<float, 21> pose_covariance(const epiline::Odometry& o) {
  Map16 J = Map16::Zero();
  J.block<3, 3>(0, 0) = flip();
  J.block<3, 3>(3, 3) = flip() * R_WB_of(o);
  return upper_triangle(J, o);
}

/// (velocity, rates) in F: v_B = R' v changes by [v_B]x dtheta + R' dv, the rate by -db_g.
std::array<float, 21> velocity_covariance(const epiline::Odometry& o, const Mat3& R_FB) {
  const Mat3 R_BW = R_WB_of(o).transpose();
  Map16 J = Map16::Zero();
  J.block<3, 3>(0, 3) = R_FB * skew(R_BW * Vec3(o.v_WB_m_s.data()));
  J.block<3, 3>(0, 6) = R_FB * R_BW;
  J.block<3, 3>(3, 12) = -R_FB;
  return upper_triangle(J, o);
}

Mat3 R_LF_of(const epiline::Odometry& o, const Mat3& R_VB) { return flip() * R_WB_of(o) * R_VB.transpose() * flip(); }

template <class Message>
void set_position(Message& message, const epiline::Odometry& o) {
  const Vec3 p = flip() * Vec3(o.p_WB_m.data());
  message.x = static_cast<float>(p.x());
  message.y = static_cast<float>(p.y());
  message.z = static_cast<float>(p.z());
  message.reset_counter = static_cast<std::uint8_t>(o.reset_counter);
}

std::uint64_t microseconds(HostStamp stamp) { return static_cast<std::uint64_t>(stamp.ns / 1000); }

std::int8_t quality_of(const Health& health) {
  if (health.state == HealthState::kInitialising || health.state == HealthState::kLost) return -1;
  return static_cast<std::int8_t>(std::clamp(health.quality, 1, 100));
}

}  // namespace

Odometry odometry_message(const epiline::Odometry& odometry, const Mat3& R_VB) {
  const Mat3 R_FB = flip() * R_VB;
  const Vec3 v_F = R_FB * (R_WB_of(odometry).transpose() * Vec3(odometry.v_WB_m_s.data()));
  const Vec3 omega_F = R_FB * Vec3(odometry.omega_B_rad_s.data());
  const Eigen::Quaternionf q(Eigen::Quaterniond(R_LF_of(odometry, R_VB)).normalized().cast<float>());
  Odometry message;
  message.time_usec = microseconds(odometry.stamp);
  set_position(message, odometry);
  message.q = {q.w(), q.x(), q.y(), q.z()};
  message.vx = static_cast<float>(v_F.x());
  message.vy = static_cast<float>(v_F.y());
  message.vz = static_cast<float>(v_F.z());
  message.rollspeed = static_cast<float>(omega_F.x());
  message.pitchspeed = static_cast<float>(omega_F.y());
  message.yawspeed = static_cast<float>(omega_F.z());
  message.pose_covariance = pose_covariance(odometry);
  message.velocity_covariance = velocity_covariance(odometry, R_FB);
  message.quality = quality_of(odometry.health);
  return message;
}

VisionPositionEstimate vision_position_message(const epiline::Odometry& odometry, const Mat3& R_VB) {
  const Mat3 R_LF = R_LF_of(odometry, R_VB);
  VisionPositionEstimate message;
  message.usec = microseconds(odometry.stamp);
  set_position(message, odometry);
  message.roll = static_cast<float>(std::atan2(R_LF(2, 1), R_LF(2, 2)));
  message.pitch = static_cast<float>(std::asin(std::clamp(-R_LF(2, 0), -1.0, 1.0)));
  message.yaw = static_cast<float>(std::atan2(R_LF(1, 0), R_LF(0, 0)));
  message.covariance = pose_covariance(odometry);
  return message;
}

ImuSample imu_sample(const HighresImu& message) {
  ImuSample sample;
  Eigen::Map<Vec3>(sample.angular_velocity_rad_s.data()) = flip() * Vec3(message.xgyro, message.ygyro, message.zgyro);
  Eigen::Map<Vec3>(sample.specific_force_m_s2.data()) = flip() * Vec3(message.xacc, message.yacc, message.zacc);
  return sample;
}

ImuSample imu_sample(const RawImu& message) {
  constexpr double kAcceleration_m_s2 = 9.80665e-3, kRate_rad_s = 1e-3;
  ImuSample sample;
  Eigen::Map<Vec3>(sample.angular_velocity_rad_s.data()) =
      kRate_rad_s * (flip() * Vec3(message.xgyro, message.ygyro, message.zgyro));
  Eigen::Map<Vec3>(sample.specific_force_m_s2.data()) =
      kAcceleration_m_s2 * (flip() * Vec3(message.xacc, message.yacc, message.zacc));
  return sample;
}

}  // namespace epiline::mavlink
