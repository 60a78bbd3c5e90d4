#pragma once
// A start at rest: tilt and gyroscope bias from the mean readings; yaw and position are free and set to zero.
#include <optional>

#include "estimator/config.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/stationary.h"
#include "estimator/statistics.h"

namespace epiline {

/// m/s^2: a mean force further from gravity is no bias; what the vehicle stands on moves.
inline constexpr double kForceTolerance = 0.6;

/// The biases that explain the readings of a vehicle that stands, with standard deviations of an axis; that of b_a
/// beside what the attitude's error makes of gravity.
struct RestBiases {
  Vec3 b_a = Vec3::Zero(), b_g = Vec3::Zero();  ///< m/s^2, rad/s
  double sigma_b_a = 0, sigma_b_g = 0;
};
RestBiases biases_at_rest(const ImuStatistics& rest, const ImuScale& scale, const Mat3& R_WB) noexcept;

/// Of a standing state with these biases, whose pose has the covariance that it has in `P`.
StateCovariance covariance_at_rest(const RestBiases& at_rest, const Mat3& R_WB, const StateCovariance& P) noexcept;

/// The attitude R_WB with `up_B` (unit) along world z and the body's x axis (or, where that is vertical, its y axis)
/// without yaw.
Mat3 levelled(const Vec3& up_B);

/// The rotation about the vertical (rad) that brings `R_WB` closest to `reference`. It does not use the heading of a
/// body axis, which is undefined where that axis is vertical.
double heading_from(const Mat3& R_WB, const Mat3& reference);

/// Empty: `state` (R_WB with zero yaw, b_g, deviations) is good. kBiasImplausible: the mean force is not gravity within
/// `force_tolerance` (m/s^2), so either the body accelerates or the accelerometer is broken.
[[nodiscard]] std::optional<StartRefusal> solve_stationary_start(const ImuStatistics& rest, const ImuNoise& noise,
                                                                 double b_a_sigma, InitialState& state,
                                                                 double force_tolerance = kForceTolerance);

}  // namespace epiline
