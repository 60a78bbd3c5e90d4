#pragma once
// A state's covariance carried on by the IMU. Derivation: docs/derivations/prediction.md.
#include "estimator/geometry/types.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"

namespace epiline {

/// Covariance of a state and the time offset, p and v in the axes of the state's own body: what preintegration speaks
/// of.
struct BodyCovariance {
  Mat15 states;
  Vec15 time_offset;  ///< with the time offset
  double offset_variance = 0;
};

/// `P`: order as in Odometry, p and v in W; `R_WB`: of that state.
BodyCovariance into_body(const StateCovariance& P, const Mat3& R_WB) noexcept;

/// At the end of an interval that begins at that state, whose attitude was `R_WB`; p and v in W. Symmetric.
StateCovariance carried_on(const BodyCovariance& from, const Mat3& R_WB, const Preintegration& interval) noexcept;

/// How well the place and the heading of a world are known to whom its states are handed: it is turned about the
/// vertical through `p` and shifted. No reading and no image tells of either, so this stays out of every estimate in
/// that world.
struct WorldUncertainty {
  Vec3 p = Vec3::Zero();
  double sigma_p = 0;    ///< m, of each axis
  double sigma_yaw = 0;  ///< rad
};

/// What that adds to the covariance of a state in this world; order as in Odometry.
StateCovariance covariance_added(const WorldUncertainty& world, const NavState& x) noexcept;

}  // namespace epiline
