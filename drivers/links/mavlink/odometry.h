#pragma once
// Our odometry in MAVLink's frames, its IMU in ours: the one place where left and up become right and down. Page:
// docs/mavlink.md.
#include "drivers/links/mavlink/message.h"
#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline::mavlink {

/// MAVLink's local frame L (LOCAL_FRD) is our world W seen with x as it is, y and z negated: z down. Its body frame F
/// (BODY_FRD) has x forward, y right, z down. `R_VB` turns vectors of the IMU's axes B into the vehicle's V, forward,
/// left and up; F is V with y and z negated.
///
/// The pose is that of the IMU: where it sits in the vehicle is a setting of the flight controller (EKF2_EV_POS,
/// VISO_POS). Velocity and rates are given in F. Covariance of position and rotation is about the axes of L, so that
/// its yaw is the heading, whatever the attitude; that of velocity in F has the doubt about attitude in it. The rates'
/// is that of the gyroscope's bias. An estimate that is not finite gives covariances that are "unknown".
///
/// Quality: -1 where the estimate is lost or not there yet, else 1 to 100 (0 would mean unknown).
Odometry odometry_message(const epiline::Odometry& odometry, const Mat3& R_VB);

/// The same for flight controllers that take no ODOMETRY. Roll, pitch and yaw turn F into L, about x after y after z.
VisionPositionEstimate vision_position_message(const epiline::Odometry& odometry, const Mat3& R_VB);

/// Readings of a flight controller's IMU, which it has turned into F, in V: the body frame B of who takes them. Only
/// the values; whose clock the stamp is on, is not for here to know.
ImuSample imu_sample(const HighresImu& message);
/// As ArduPilot fills it: thousandths of 9.80665 m/s^2, and of rad/s.
ImuSample imu_sample(const RawImu& message);

}  // namespace epiline::mavlink
