#pragma once
// What the user knows of the camera's pose on the IMU and of its focal length. Derivation:
// docs/derivations/calibration.md#prior; test: tests/estimator/factors/calibration_prior_test.cc.
#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// Rotation, place and focal length each have a Student distribution about the configured value: a good calibration is
/// held, and one that is wrong lets go. Belongs to the calibration, so a frame that goes takes nothing of it along.
/// Returns the cost; null: the cost alone.
double add_calibration_prior(const Window& window, const Share& share, NormalEquations* out);

/// Of each number, where the calibration is off the configured one by `d`.
CalibrationTangent calibration_prior_information(const CalibrationPrior& prior, const CalibrationTangent& d) noexcept;

/// Looks for a truth far from the configured values that all measurements so far make likelier. `covariance`, `solved`:
/// the calibration by a solve that was linearised at `linearised` under this prior; the next solve holds the
/// calibration as little as one that far away. `dt_s`: since the last such look. Returns whether one was found that is
/// farther off than what was held to.
bool look_far(const CalibrationCovariance& covariance, const Calibration& linearised, const Calibration& solved,
              double dt_s, CalibrationPrior& prior) noexcept;

/// G, by which a state's covariance grows, cross G cross^T, where the truth of the calibration may be far off, by the
/// last look: the state would be another one then. `covariance`: of the solved calibration; `cross`: of the state with
/// it.
CalibrationCovariance growth_by_tails(const CalibrationPrior& prior, const CalibrationCovariance& covariance) noexcept;

/// Variances of the lens' numbers and of both scales of the IMU, in the order of their columns, that the tracks cannot
/// tell: what a lens of another shape than its model's does to all four, and, with several cameras, what an error of
/// their baseline does to the focal length.
using LensDoubt = Eigen::Vector4d;
LensDoubt doubt_of_lens(const CalibrationPrior& prior, const Calibration& solved,
                        const CalibrationCovariance& covariance, const Rig& rig) noexcept;
/// The same G for those.
CalibrationCovariance growth_by_doubt(const LensDoubt& doubt, const CalibrationCovariance& covariance) noexcept;

}  // namespace epiline
