#pragma once
// The path the IMU dictates once the state at frame 0 is given, with its derivatives. Derivation:
// docs/derivations/initialisation.md.
#include "estimator/initialise/start_problem.h"

namespace epiline {

/// Tangent of StartState: v_0, two turns of g_0 about gravity_basis(), b_g, b_a.
using StartVector = Eigen::Matrix<double, kStartDof, 1>;
using StartMatrix = Eigen::Matrix<double, kStartDof, kStartDof>;
using StartRows = Eigen::Matrix<double, 3, kStartDof>;

/// Two unit vectors that span the plane orthogonal to g.
Eigen::Matrix<double, 3, 2> gravity_basis(const Vec3& g);
/// state (+) d.
StartState moved(const StartState& state, const StartVector& d);

/// Frame k in B_0: p = v_0 T + g_0 T^2 / 2 + alpha, v = v_0 + g_0 T + beta.
struct StartFrame {
  double T = 0;  ///< since frame 0, s
  Mat3 R = Mat3::Identity();
  Vec3 alpha = Vec3::Zero(), beta = Vec3::Zero();
  Eigen::Matrix<double, 3, 6> alpha_b = Eigen::Matrix<double, 3, 6>::Zero();  ///< by (b_g, b_a)
  Eigen::Matrix<double, 3, 6> beta_b = Eigen::Matrix<double, 3, 6>::Zero();
  Mat3 theta_b = Mat3::Zero();  ///< right perturbation of R by b_g

  Vec3 position(const StartState& s) const { return s.v_0 * T + s.g_0 * (0.5 * T * T) + alpha; }
  Vec3 velocity(const StartState& s) const { return s.v_0 + s.g_0 * T + beta; }
  /// d position / d tangent.
  StartRows position_rows(const Vec3& g_0) const;
  /// d (rotation, perturbed from the left: R <- Exp(dphi) R) / d b_g.
  Mat3 rotation_rows() const { return R * theta_b; }
};

using StartPath = std::array<StartFrame, kStartFrames>;

/// Chains the intervals, each moved to the biases by its own first-order Jacobians.
void chain(const StartProblem& problem, const Vec3& b_g, const Vec3& b_a, StartPath& path);

}  // namespace epiline
