#pragma once
// The forward speed measured by a ground vehicle's wheels, as a residual of one frame. Derivation:
// docs/derivations/wheel.md; test: tests/estimator/factors/wheel_test.cc.
#include "estimator/config.h"
#include "estimator/factors/normal_equations.h"
#include "estimator/inertial/nav_state.h"
#include "estimator/window/window.h"

namespace epiline {

using Row15 = Eigen::Matrix<double, 1, 15>;

/// r = speed of the wheels' point along the forward axis, by the state, minus the measured one, m/s. J: d r / d delta,
/// tangent order (p, theta, v, b_a, b_g). Robust, both in units of the standard deviation: `weight` multiplies J'J and
/// J'r, `cost` is the kernel of r squared.
struct WheelResidual {
  double r = 0, weight = 0, cost = 0;
  Row15 J = Row15::Zero();
};

/// Residual at x. `omega`: angular rate of the body at that instant, bias not removed. The Jacobian takes rotation and
/// velocity from the linearisation point l; pass x itself for the plain Jacobian.
void evaluate_wheel(const WheelModel& wheel, double speed_m_s, const Vec3& omega, const NavState& x, const NavState& l,
                    WheelResidual& out);

/// Returns the cost; null: the cost alone.
double add_wheel(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
