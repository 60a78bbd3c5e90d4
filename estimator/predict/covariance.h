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

}  // namespace epiline
