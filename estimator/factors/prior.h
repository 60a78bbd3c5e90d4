#pragma once
// The Gaussian prior that remains of frames that have left. Derivation: docs/derivations/marginalisation.md; test:
// tests/estimator/factors/prior_test.cc.
#include <span>

#include "estimator/config.h"
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// d = x [-] x0 in the prior's order.
void prior_difference(const Window& window, double* d);

/// Returns d'H d - 2 b'd, which may be negative; null: the cost alone.
double add_prior(const Window& window, NormalEquations* out);

/// The numbers from row `at` on may have moved by as much: adds moved moved' to their prior covariance. The estimate
/// does not change.
void inflate(Prior& prior, int at, std::span<const double> moved);

/// What is known of a single first frame at its present state and of the calibration.
struct KnownJointly {
  StateCovariance P;  ///< that of the time offset is not used
  CalibrationCovariance calibration = CalibrationCovariance::Zero();
  CrossCovariance cross = CrossCovariance::Zero();  ///< of both
  /// Of the calibration's information, what its own prior (calibration_prior.h) said.
  CalibrationTangent own = CalibrationTangent::Zero();
  double time_offset_sigma = 0;  ///< known by itself; 0: not estimated
};
/// A prior with that knowledge, less what the calibration's own prior says, which each solve adds.
void set_prior(Window& window, const KnownJointly& known);

/// The same as set_prior() from standard deviations in tangent order, tilt and yaw given separately.
void set_initial_prior(Window& window, const InitialState& sigmas, const CalibrationTangent& calibration_sigmas);

}  // namespace epiline
