#pragma once
// A start at rest: tilt and gyroscope bias from the mean readings; yaw and position are free and set to zero.
#include <optional>

#include "estimator/config.h"
#include "estimator/statistics.h"

namespace epiline {

/// Mean readings over a stretch at rest, in B.
struct RestReadings {
  Vec3 specific_force = Vec3::Zero();  ///< m/s^2
  Vec3 rate = Vec3::Zero();            ///< rad/s
  double duration_s = 0;
};

/// The attitude R_WB with `up_B` (unit) along world z and the body's x axis (or, where that is vertical, its y axis)
/// without yaw.
Mat3 levelled(const Vec3& up_B);

/// The rotation about the vertical (rad) that brings `R_WB` closest to `reference`. It does not use the heading of a
/// body axis, which is undefined where that axis is vertical.
double heading_from(const Mat3& R_WB, const Mat3& reference);

/// Empty: `state` (R_WB with zero yaw, b_g, deviations) is good. kBiasImplausible: the mean force is not gravity within
/// `force_tolerance` (m/s^2), so either the body accelerates or the accelerometer is broken.
[[nodiscard]] std::optional<StartRefusal> solve_stationary_start(const RestReadings& rest, const ImuNoise& noise,
                                                                 double b_a_sigma, InitialState& state,
                                                                 double force_tolerance = 0.6);

}  // namespace epiline
