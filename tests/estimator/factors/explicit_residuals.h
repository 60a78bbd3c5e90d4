#pragma once
// Visual factors written down directly, their Jacobians numerical.
#include <Eigen/Core>
#include <functional>
#include <initializer_list>

#include "estimator/factors/visual.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

/// A pinhole camera's centre and attitude when it took frame k.
struct Camera {
  Mat3 R;
  Vec3 c;
};
Camera camera(const Window& w, int k);

Eigen::VectorXd central_difference(const std::function<Eigen::VectorXd(double)>& at);
/// Slopes of a residual of `rows` numbers by the poses of `frames` frames (dp, then dphi in the world), of which it
/// depends on a few and on those after them, and by the calibration.
Eigen::MatrixXd slopes(Window& w, int rows, int frames, std::initializer_list<int> on,
                       const std::function<Eigen::VectorXd()>& residual);
/// Adds a residual under Huber's kernel.
void add_huber(const Eigen::MatrixXd& J, const Eigen::VectorXd& r, Eigen::MatrixXd& H, Eigen::VectorXd& b,
               double& cost);

/// Poses of frames 0..frames-1 (world perturbations), then the calibration.
Eigen::MatrixXd dense(const VisualSystem& v, int frames);
Eigen::VectorXd dense_rhs(const VisualSystem& v, int frames);

/// What is known of each unknown; 1 where nothing is said of it.
Eigen::VectorXd units(const Eigen::MatrixXd& H);
/// Largest difference of two matrices whose unknowns differ in unit, relative to the diagonal of the second.
double scaled_difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);
/// The same of right-hand sides, the units being those of `H`.
double scaled_difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::MatrixXd& H);

}  // namespace epiline::test
