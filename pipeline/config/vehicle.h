#pragma once
// How the IMU sits in the vehicle, for the estimator's wheel factor.
#include "estimator/estimator.h"
#include "pipeline/config/devices.h"

namespace epiline {

/// Fills in the axis and the point of the speed. `R_VB` turns vectors of the IMU's axes into the vehicle's: forward,
/// left, up.
inline void set_vehicle(WheelModel& wheel, const WheelConfig& config, const Mat3& R_VB) {
  wheel.forward_B = R_VB.transpose() * Vec3::UnitX();
  wheel.p_BV = R_VB.transpose() * Vec3(config.x_m, config.y_m, config.z_m);
}

}  // namespace epiline
