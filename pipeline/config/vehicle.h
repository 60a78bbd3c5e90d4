#pragma once
// How the IMU sits in the vehicle.
#include "estimator/estimator.h"
#include "pipeline/config/devices.h"

namespace epiline {

/// Turns vectors of the IMU's axes B into the vehicle's V: forward, left, up.
Mat3 R_VB_of(const BodyConfig& body);

/// Fills in the axis and the point of the wheels' speed, with R_VB_of() the body.
void set_vehicle(WheelModel& wheel, const WheelConfig& config, const Mat3& R_VB);

}  // namespace epiline
