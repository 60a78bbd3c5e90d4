#pragma once
// How the IMU sits in the vehicle.
#include "estimator/estimator.h"
#include "pipeline/config/config.h"

namespace epiline {

/// Turns vectors of the IMU's axes B into the vehicle's V: forward, left, up.
Mat3 R_VB_of(const BodyConfig& body);

/// Fills in what the estimator must know of the vehicle: the axis and the point of the wheels' speed, place and beam of
/// the range finder.
void set_vehicle(Config& config);

}  // namespace epiline
