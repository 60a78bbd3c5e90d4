#pragma once
// Propagates a state's covariance by the IMU. Derivation: docs/derivations/prediction.md.
#include "estimator/geometry/types.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"

namespace epiline {

/// Covariance of a state and the time offset, with p and v in the axes of the state's own body, as preintegration uses
/// them.
struct BodyCovariance {
  Mat15 states;
  Vec15 time_offset;  ///< with the time offset
  double offset_variance = 0;
};

/// `P`: order as in Odometry, p and v in W; `R_WB`: of that state.
BodyCovariance into_body(const StateCovariance& P, const Mat3& R_WB) noexcept;

/// At the end of an interval that begins at that state, whose attitude was `R_WB`; p and v in W. Symmetric.
StateCovariance carried_on(const BodyCovariance& from, const Mat3& R_WB, const Preintegration& interval) noexcept;

/// What a covariance says of tilt, velocity and biases alone: without place and heading, which the world's origin
/// defines. Order as in Odometry. Symmetric.
StateCovariance without_origin(const NavState& x, const StateCovariance& P) noexcept;

/// Multiplies the variances of tilt, velocity and biases, as if by an independent error. Place and heading, which the
/// world's origin defines, stay as certain as they were.
void widen(const NavState& x, double factor, StateCovariance& P) noexcept;

/// Uncertainty of the position and heading of a world for the receiver of its states: the world may be shifted, and
/// rotated about the vertical through `p`. No sample and no image observes either, so no estimate in that world
/// includes this uncertainty.
struct WorldUncertainty {
  Vec3 p = Vec3::Zero();
  double sigma_p = 0;    ///< m, of each axis
  double sigma_yaw = 0;  ///< rad
};

/// The contribution of that uncertainty to the covariance of a state in this world; order as in Odometry.
StateCovariance covariance_added(const WorldUncertainty& world, const NavState& x) noexcept;

}  // namespace epiline
