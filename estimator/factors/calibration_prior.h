#pragma once
// What the user knows of the camera's pose on the IMU. Derivation: docs/derivations/calibration.md#prior; test:
// tests/estimator/factors/calibration_prior_test.cc.
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// Rotation and place each have a Student distribution about the configured value: a good calibration is held, and one
/// that is wrong lets go. Belongs to the calibration, so a frame that goes takes nothing of it along. Returns the cost;
/// null: the cost alone.
double add_calibration_prior(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
