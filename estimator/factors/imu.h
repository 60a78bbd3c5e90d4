#pragma once
// The IMU residual between two frames. Derivation: docs/derivations/imu.md; test: tests/estimator/factors/imu_test.cc.
#include "estimator/factors/kernels.h"
#include "estimator/factors/normal_equations.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/inertial/preintegration.h"
#include "estimator/window/window.h"

namespace epiline {

/// r: (r_p, r_theta, r_v, r_ba, r_bg), not whitened; J: d r / d (delta_i, delta_j, s_a, s_g), tangent order (p, theta,
/// v, b_a, b_g) of each frame.
struct ImuResidual {
  Vec15 r;
  alignas(64) Eigen::Matrix<double, 15, 32, Eigen::RowMajor> J;
};

/// Residual and Jacobian at (x_i, x_j).
void evaluate_imu(const Preintegration& z, const ImuScale& scale, const NavState& x_i, const NavState& x_j,
                  ImuResidual& out);

/// The residual alone.
Vec15 imu_residual(const Preintegration& z, const ImuScale& scale, const NavState& x_i, const NavState& x_j);

/// L^-1 (lower) with L L^T = C: whitens the residual and its Jacobian; constant while the interval is. False if and
/// only if C is not positive definite (an interval without samples); `L_inverse` is then unspecified.
bool square_root_information(const Preintegration& z, Mat15& L_inverse);

/// Square-root information of the slot's IMU interval; to be called whenever `imu` changed. False: covariance not
/// positive.
bool whiten(Slot& slot);

/// Squared standard deviations by which frames k - 1 and k, as they are estimated, contradict the readings.
double imu_chi2(const Window& window, int k);

/// The same of attitude and gyroscope bias alone; 0 for an interval that says nothing of the motion.
double imu_chi2_of_turn(const Window& window, int k);

/// All IMU intervals of the share. Returns the cost; null: the cost alone.
double add_imu(const Window& window, const Share& share, const FactorKernels& kernels, NormalEquations* out);

}  // namespace epiline
