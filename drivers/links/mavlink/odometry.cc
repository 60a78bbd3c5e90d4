#include "drivers/links/mavlink/odometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/links/stream/vehicle_odometry.h"

namespace epiline::mavlink {

namespace {

/// Up to down: y and z negated. Its own inverse.
Mat3 flip() { return Vec3(1, -1, -1).asDiagonal(); }

/// The same for three numbers and three more.
Covariance6 flipped(const Covariance6& upper_triangle) {
  constexpr std::array<float, 6> kSigns = {1, -1, -1, 1, -1, -1};
  Covariance6 flipped{};
  for (std::size_t i = 0, at = 0; i < 6; ++i)
    for (std::size_t j = i; j < 6; ++j, ++at) flipped[at] = kSigns[i] * kSigns[j] * upper_triangle[at];
  return flipped;
}

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

Mat3 about_up(double angle_rad) { return Eigen::AngleAxisd(angle_rad, Vec3::UnitZ()).toRotationMatrix(); }

Eigen::Quaterniond attitude_of(const epiline::Odometry& o) {
  return Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]);
}

/// The world turned by R; the covariance of position and velocity turns with it, that of the attitude is in B.
epiline::Odometry in_turned_world(const epiline::Odometry& odometry, const Mat3& R) {
  using Covariance16 = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
  epiline::Odometry o = odometry;
  Eigen::Map<Vec3>(o.p_WB_m.data()) = R * Vec3(odometry.p_WB_m.data());
  Eigen::Map<Vec3>(o.v_WB_m_s.data()) = R * Vec3(odometry.v_WB_m_s.data());
  const Eigen::Quaterniond q = (Eigen::Quaterniond(R) * attitude_of(odometry)).normalized();
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Covariance16> C(o.covariance.data());
  for (const int at : {0, 6}) {
    const Eigen::Matrix<double, 3, 16> rows = R * C.block<3, 16>(at, 0);
    C.block<3, 16>(at, 0) = rows;
    const Eigen::Matrix<double, 16, 3> columns = C.block<16, 3>(0, at) * R.transpose();
    C.block<16, 3>(0, at) = columns;
  }
  return o;
}

/// In B, from a message whose 1 means these rates and accelerations.
template <class Message>
ImuSample in_units(const Message& message, double rate_rad_s, double acceleration_m_s2) {
  ImuSample sample;
  Eigen::Map<Vec3>(sample.angular_velocity_rad_s.data()) =
      rate_rad_s * (flip() * Vec3(message.xgyro, message.ygyro, message.zgyro));
  Eigen::Map<Vec3>(sample.specific_force_m_s2.data()) =
      acceleration_m_s2 * (flip() * Vec3(message.xacc, message.yacc, message.zacc));
  return sample;
}

}  // namespace

Status fault_of_frame(const MavlinkConfig& config) {
  const bool is_north = config.frame == 1;
  if (is_north == (config.heading_deg >= 0)) return Done{};
  if (is_north)
    return Error{ErrorKind::kUsage, "mavlink.frame", 0, "local-ned without mavlink.heading_deg",
                 "the vehicle's heading at the first pose, in degrees clockwise from true north; or local-frd"};
  return Error{ErrorKind::kUsage, "mavlink.heading_deg", 0, "a heading with mavlink.frame = \"local-frd\"",
               "mavlink.frame = \"local-ned\", which has a north; or no heading"};
}

LocalFrame::LocalFrame(const MavlinkConfig& config) noexcept {
  if (config.frame == 1) heading_rad_ = config.heading_deg * std::numbers::pi / 180;
}

void LocalFrame::see(const epiline::Odometry& odometry, const Mat3& R_VB) noexcept {
  if (!heading_rad_ || turn_rad_) return;
  const Mat3 R_WV = attitude_of(odometry).toRotationMatrix() * R_VB.transpose();
  const double yaw = std::atan2(R_WV(1, 0), R_WV(0, 0));  // anticlockwise; a heading goes the other way round
  turn_rad_ = -*heading_rad_ - yaw;
}

epiline::Odometry LocalFrame::of(const epiline::Odometry& odometry) const noexcept {
  return turn_rad_ ? in_turned_world(odometry, about_up(*turn_rad_)) : odometry;
}

Odometry odometry_message(const epiline::Odometry& in_world, const Mat3& R_VB, const LocalFrame& frame) {
  const epiline::Odometry odometry = frame.of(in_world);
  const VehicleOdometry vehicle = in_vehicle_axes(odometry, R_VB);
  const std::array<float, 4>& q = vehicle.q_WV;
  Odometry message;
  message.time_usec = microseconds(odometry.stamp);
  set_position(message, odometry);
  message.q = {q[0], q[1], -q[2], -q[3]};
  message.vx = vehicle.v_V_m_s.x();
  message.vy = -vehicle.v_V_m_s.y();
  message.vz = -vehicle.v_V_m_s.z();
  message.rollspeed = vehicle.omega_V_rad_s.x();
  message.pitchspeed = -vehicle.omega_V_rad_s.y();
  message.yawspeed = -vehicle.omega_V_rad_s.z();
  message.pose_covariance = flipped(vehicle.pose_covariance);
  message.velocity_covariance = flipped(vehicle.velocity_covariance);
  message.quality = quality_of(odometry.health);
  message.frame_id = frame.id();
  return message;
}

VisionPositionEstimate vision_position_message(const epiline::Odometry& in_world, const Mat3& R_VB,
                                               const LocalFrame& frame) {
  const epiline::Odometry odometry = frame.of(in_world);
  const VehicleOdometry vehicle = in_vehicle_axes(odometry, R_VB);
  const Mat3 R_LF = flip() * vehicle.R_WV * flip();
  VisionPositionEstimate message;
  message.usec = microseconds(odometry.stamp);
  set_position(message, odometry);
  message.roll = static_cast<float>(std::atan2(R_LF(2, 1), R_LF(2, 2)));
  message.pitch = static_cast<float>(std::asin(std::clamp(-R_LF(2, 0), -1.0, 1.0)));
  message.yaw = static_cast<float>(std::atan2(R_LF(1, 0), R_LF(0, 0)));
  message.covariance = flipped(vehicle.pose_covariance);
  return message;
}

ImuSample imu_sample(const HighresImu& message) { return in_units(message, 1, 1); }
ImuSample imu_sample(const RawImu& message) { return in_units(message, 1e-3, 9.80665e-3); }

}  // namespace epiline::mavlink
