// The solver's step against that of bundle adjustment with explicit points, its Jacobians numerical.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "tests/estimator/dense_system.h"
#include "tests/estimator/solver/solver_fixture.h"

namespace epiline {
namespace {

using test::calibration_sigmas;
using test::kEverything;
using test::NoVision;
using test::quadratic;

/// Bearing residual of the point X (in W), in sigmas, with the body moved by its velocity and rate to the exposure; the
/// model of docs/derivations/track.md and calibration.md written down directly.
Vec2 bearing_residual(const Observation& o, double inverse_sigma, const NavState& x, const Vec3& v, const Vec3& omega_B,
                      const Calibration& c, double time_offset_used, const Vec3& X) {
  const double dt = c.time_offset - time_offset_used;
  const Mat3 R = x.R * so3_exp(omega_B * dt);
  const Vec3 X_C = c.R_BC.transpose() * (R.transpose() * (X - x.p - v * dt) - c.p_BC);
  const Vec3 by_lens(X_C.x(), X_C.y(), (1 - c.focal) * X_C.z());
  return inverse_sigma * (chart_of(o) * by_lens / bearing_of(o).dot(by_lens));
}

/// Central differences of a residual along `dims` directions.
Eigen::MatrixXd numeric_jacobian(int dims, const std::function<Vec2(int, double)>& moved) {
  constexpr double h = 1e-5;
  Eigen::MatrixXd J(2, dims);
  for (int i = 0; i < dims; ++i) J.col(i) = (moved(i, h) - moved(i, -h)) / (2 * h);
  return J;
}

struct BundleAdjustment {
  const Window& w;
  double inverse_sigma;

  /// By both positions and the forces between them; of the newest frame its own.
  Vec3 velocity(int k, const NavState& pose, const Vec3& next) const {
    if (k + 1 == w.size()) return pose.v;
    const Preintegration& imu = w.at(k + 1).imu;
    return (next - pose.p - pose.R * imu.dp - 0.5 * imu.T * imu.T * kGravity_W) / imu.T;
  }
  Vec3 next_position(int k) const { return w.at(std::min(k + 1, w.size() - 1)).x.p; }
  Vec2 residual(const TrackRecord& t, int k, const NavState& pose, const Vec3& next, const Calibration& c,
                const Vec3& X) const {
    const Slot& s = w.at(k);
    return bearing_residual(w.view(t, k), inverse_sigma, pose, velocity(k, pose, next), s.omega - s.x.b_g, c,
                            s.time_offset_used, X);
  }
  Vec2 residual(const TrackRecord& t, int k, const Vec3& X) const {
    return residual(t, k, w.at(k).x, next_position(k), w.calibration, X);
  }
  Eigen::MatrixXd by_point(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(3, [&](int i, double h) { return residual(t, k, X + h * Vec3::Unit(i)); });
  }
  Eigen::MatrixXd by_pose(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(6, [&](int i, double h) {
      NavState x = w.at(k).x;
      retract_pose(x, h * Vec6::Unit(i));
      return residual(t, k, x, next_position(k), w.calibration, X);
    });
  }
  Eigen::MatrixXd by_next_position(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(3, [&](int i, double h) {
      return residual(t, k, w.at(k).x, next_position(k) + h * Vec3::Unit(i), w.calibration, X);
    });
  }
  Eigen::MatrixXd by_calibration(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(kCalibration, [&](int i, double h) {
      Calibration c = w.calibration;
      retract(c, h * CalibrationTangent::Unit(i));
      return residual(t, k, w.at(k).x, next_position(k), c, X);
    });
  }
  /// The point that fits the bearings best at the current poses: rays first, then Gauss-Newton.
  Vec3 point(const TrackRecord& t) const {
    Mat3 A = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    for (int k = 0; k < w.size(); ++k) {
      if (!w.seen(t, k)) continue;
      const NavState& x = w.at(k).x;
      const Vec3 f = x.R * w.calibration.R_BC * bearing_of(w.view(t, k)), c = x.p + x.R * w.calibration.p_BC;
      const Mat3 across = Mat3::Identity() - f * f.transpose();
      A += across;
      b += across * c;
    }
    Vec3 X = A.ldlt().solve(b);
    for (int i = 0; i < 30; ++i) {
      Mat3 H = Mat3::Zero();
      Vec3 g = Vec3::Zero();
      for (int k = 0; k < w.size(); ++k) {
        if (!w.seen(t, k)) continue;
        const Eigen::MatrixXd J = by_point(t, k, X);
        H += J.transpose() * J;
        g += J.transpose() * residual(t, k, X);
      }
      X -= H.ldlt().solve(g);
    }
    return X;
  }
};

TEST(Solver, StepEqualsThatOfBundleAdjustmentWithExplicitPoints) {
  SyntheticWindow s = make_window({.frames = 6, .tracks = 40});
  Window& w = *s.window;
  w.calibration.time_offset = 1e-3;
  set_initial_prior(w, {}, calibration_sigmas());
  const VisualSettings settings = quadratic(true);
  Solver solver(best_instruction_set());
  NoVision none;
  solver.linearise(w, none, kEverything);
  const DenseSystem inertial = dense(solver.system());

  // poses, velocities, biases and calibration as in DenseSystem, then three unknowns a point
  const BundleAdjustment ba{w, 1 / (settings.pixel_sigma * settings.sigma_inflation)};
  const int n = w.size(), states = static_cast<int>(inertial.b.size()), total = states + 3 * w.track_count();
  DenseSystem full{Eigen::MatrixXd::Zero(total, total), Eigen::VectorXd::Zero(total)};
  full.H.topLeftCorner(states, states) = inertial.H;
  full.b.head(states) = inertial.b;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    ASSERT_GE(w.views(t), 2);
    const Vec3 X = ba.point(t);
    for (int k = 0; k < n; ++k) {
      if (!w.seen(t, k)) continue;
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, total);
      J.middleCols(pose_column(k), 6) = ba.by_pose(t, k, X);
      if (k + 1 < n) J.middleCols(pose_column(k + 1), 3) = ba.by_next_position(t, k, X);
      J.middleCols(calibration_column(n), kCalibration) = ba.by_calibration(t, k, X);
      J.middleCols(states + 3 * i, 3) = ba.by_point(t, k, X);
      full.H += J.transpose() * J;
      full.b -= J.transpose() * ba.residual(t, k, X);
    }
  }
  const DenseSolution reference = solve_dense(full);

  TrackFactor factor(best_instruction_set());
  factor.collect(w, settings);
  solver.linearise(w, factor, kEverything);
  const Eigen::VectorXd step = solve_with(best_instruction_set(), solver.system());
  const double difference = relative_difference(step, reference.step.head(states), reference.unit.head(states));
  EXPECT_LT(difference, 1e-6);
}

}  // namespace
}  // namespace epiline
