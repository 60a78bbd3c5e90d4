#pragma once
// Converts odometry to MAVLink's frames, and MAVLink's IMU samples to epiline's. Only this file negates y and z. Page:
// docs/flight-controller.md.
#include <optional>

#include "drivers/links/mavlink/message.h"
#include "estimator/geometry/types.h"
#include "pipeline/config/devices.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline::mavlink {

/// The frame of the poses that a receiver gets, `mavlink.frame`. LOCAL_FRD is the world as it is. LOCAL_NED is the
/// world, turned about the vertical so that the vehicle has the configured heading in the first odometry. The turn then
/// stays the same, also when the estimator starts again: what the estimate's heading drifted until then stays in it.
class LocalFrame {
 public:
  /// Of which the settings are complete: fault_of_frame() names none.
  explicit LocalFrame(const MavlinkConfig& config) noexcept;
  /// LOCAL_FRD.
  LocalFrame() noexcept : LocalFrame(MavlinkConfig{}) {}

  /// Takes the heading from the first odometry. Call it for each one before it is converted; later ones change nothing.
  void see(const epiline::Odometry& odometry, const Mat3& R_VB) noexcept;
  /// The odometry in a world that has x to the north; in LOCAL_FRD as it is. Its attitude is of norm 1.
  epiline::Odometry of(const epiline::Odometry& odometry) const noexcept;
  /// MAV_FRAME.
  std::uint8_t id() const noexcept { return heading_rad_ ? 1 : 20; }

 private:
  std::optional<double> heading_rad_;  ///< wanted, clockwise; none: LOCAL_FRD
  std::optional<double> turn_rad_;     ///< of the world, anticlockwise seen from above
};
/// An error if and only if `mavlink.frame` and `mavlink.heading_deg` contradict each other.
Status fault_of_frame(const MavlinkConfig& config);

/// MAVLink's local frame L (LOCAL_FRD) is the world W with y and z negated: z down. Its body frame F
/// (BODY_FRD) has x forward, y right, z down. `R_VB` rotates vectors from the IMU's axes B to the vehicle's V (forward,
/// left, up); F is V with y and z negated.
///
/// The pose is that of the IMU; its position in the vehicle is a setting of the flight controller (EKF2_EV_POS,
/// VISO_POS). Velocity and rates are given in F. Covariance of position and rotation is about the axes of L, so that
/// its yaw is the heading, whatever the attitude; that of velocity in F includes the uncertainty of the attitude. That
/// of the rates is the covariance of the gyroscope bias. An estimate that is not finite gives covariances that are
/// "unknown".
///
/// Quality: -1 if the estimate is lost or not available yet, else 1 to 100 (0 would mean unknown).
///
/// With another `frame` than LOCAL_FRD, L is that frame.
Odometry odometry_message(const epiline::Odometry& odometry, const Mat3& R_VB, const LocalFrame& frame = {});

/// The same for flight controllers without ODOMETRY. Roll, pitch and yaw rotate F to L: first about z, then y, then x.
VisionPositionEstimate vision_position_message(const epiline::Odometry& odometry, const Mat3& R_VB,
                                               const LocalFrame& frame = {});

/// Converts an IMU sample of the flight controller from F to V, which is then the body frame B. Converts the values
/// only, not the timestamp.
ImuSample imu_sample(const HighresImu& message);
/// In ArduPilot's units: thousandths of 9.80665 m/s^2 and of rad/s.
ImuSample imu_sample(const RawImu& message);

}  // namespace epiline::mavlink
