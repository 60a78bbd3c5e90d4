#pragma once
// One estimate as a flight controller receives it, and the rules on the contents of a single message.
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/links/mavlink/message.h"
#include "drivers/program/hil/rules.h"
#include "estimator/geometry/types.h"
#include "pipeline/text/trajectory.h"

namespace epiline::hil {

/// Where the variances stand in the upper triangle of a covariance of six.
inline constexpr std::array<std::size_t, 6> kDiagonal = {0, 6, 11, 15, 18, 20};

/// From ODOMETRY or VISION_POSITION_ESTIMATE. L: the local frame (forward, right, down), F: the vehicle's body.
struct VisionSample {
  HostStamp arrival;  ///< of the last byte
  HostStamp stamp;    ///< time_usec, of the sender's clock
  Vec3 p_L = Vec3::Zero();
  Eigen::Quaterniond q_LF = Eigen::Quaterniond::Identity();
  std::optional<Vec3> v_L;
  Vec3 omega_F = Vec3::Zero();
  Vec3 sigma_p = Vec3::Zero(), sigma_angle = Vec3::Zero(), sigma_v = Vec3::Zero();  ///< 0: not known
  std::uint8_t reset_counter = 0;
  bool is_north = false;  ///< PX4 takes its frame for one with x to the north
};

/// The pose of the IMU according to the sample, in a world whose z axis points up. `R_VB`: rotation from the IMU to the
/// vehicle (forward, left, up).
TimedPose pose_of(const VisionSample& sample, const Mat3& R_VB);

/// Judges the rules on frames, type, finite numbers, covariance and quality. None: numbers or timestamp are such that
/// no controller could use the message.
std::optional<VisionSample> judge_message(const mavlink::Odometry& message, HostStamp arrival, RuleBook& book);
std::optional<VisionSample> judge_message(const mavlink::VisionPositionEstimate& message, HostStamp arrival,
                                          RuleBook& book);

}  // namespace epiline::hil
