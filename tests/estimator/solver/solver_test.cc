// The solver against dense linear algebra, against bundle adjustment with explicit points, and against the truth; what
// it does when time is up or a step fails. Derivation: docs/derivations/solver.md.
#include "estimator/solver/solver.h"

#include <gtest/gtest.h>

#include <functional>

#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "estimator/solver/marginalise.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

constexpr SolverSettings kEverything{.steps = 1, .estimate_time_offset = true, .estimate_extrinsics = true};

CalibrationTangent calibration_sigmas() {
  CalibrationTangent s;
  s << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.01);
  return s;
}

/// No kernel, no gate; the point converges within the evaluation.
VisualSettings quadratic(bool extrinsics) {
  VisualSettings s;
  s.pixel_sigma = 0.5;
  s.sigma_inflation = 1;
  s.cauchy = 1e6;
  s.gate = false;
  s.extrinsics = extrinsics;
  s.inner_steps = 12;
  s.converged = 0;
  return s;
}

/// A window of `frames` with everything in it: a prior over all frames but the two newest, rest and wheel factors,
/// calibration.
SyntheticWindow full_window(int frames) {
  const bool with_history = frames > 2;
  SyntheticWindow s = make_window({.frames = std::min(frames + (with_history ? 1 : 0), kMaxFrames)});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  w.at(1).at_rest = true;
  w.at(1).rest_link = w.at(0).id;
  w.wheel.forward_B = Vec3(0.8, 0.6, 0);
  w.wheel.p_BV = Vec3(-0.3, 0.2, -0.1);
  for (int k = 0; k < w.size(); ++k) {
    w.at(k).has_wheel = k % 3 != 2;
    w.at(k).wheel_speed_m_s = w.wheel.forward_B.dot(w.at(k).x.R.transpose() * w.at(k).x.v) + 0.02 * k;
    w.at(k).omega = Vec3(0.1, 0.2, 0.3);
  }
  if (with_history) {
    TrackFactor factor(best_instruction_set());
    const VisualSettings settings = quadratic(true);
    factor.collect(w, settings);
    Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, settings);
    for (int k = 0; k < w.prior.frames; ++k) w.at(k).x.p += Vec3(1e-3, -2e-3, 5e-4);  // off the prior's centre
    w.at(w.size() - 1).at_rest = true;
    w.at(w.size() - 1).rest_link = w.at(0).id;
  }
  if (w.size() < frames) {  // a window at its capacity: the newest frame without bearings
    const NavState x = w.newest().x;
    const Preintegration imu = w.newest().imu;
    Slot& slot = w.append();
    slot.x = x;
    slot.imu = imu;
    whiten(slot);
  }
  return s;
}

/// The visual factor that says nothing.
class NoVision final : public VisualFactorModel {
 public:
  void collect(const Window&, const VisualSettings&) noexcept override {}
  void linearise(const Window& w, VisualSystem& out) noexcept override { clear(out, w.size()); }
  double cost(const Window&) noexcept override { return 0; }
  void marginalise_oldest(const Window& w, const VisualSettings&, VisualSystem& out) noexcept override {
    clear(out, w.size());
  }
};

/// Prior, IMU, rest and wheels: the right-hand side is the slope of the cost.
TEST(Solver, GradientMatchesCentralDifferencesOfTheCost) {
  SyntheticWindow s = full_window(5);
  Window& w = *s.window;
  w.first_estimates = false;
  NoVision none;
  Solver solver(best_instruction_set());
  solver.linearise(w, none, kEverything);
  const DenseSystem at = dense(solver.system());
  const int n = w.size();
  constexpr double h = 1e-6;
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < 15; ++i) {
      const NavState keep = w.at(k).x;
      double cost[2];
      for (int side = 0; side < 2; ++side) {
        const double step = side ? -h : h;
        if (i < 6)
          retract_pose(w.at(k).x, step * Vec6::Unit(i));
        else
          retract_velocity_biases(w.at(k).x, step * Vec9::Unit(i - 6));
        cost[side] = solver.linearise(w, none, kEverything);
        w.at(k).x = keep;
      }
      const int row = i < 6 ? pose_column(n, k) + i : velocity_row(n, k) + i - 6;
      const double slope = -0.25 * (cost[0] - cost[1]) / h;  // cost = r'r, b = -J'r
      EXPECT_NEAR(at.b[row], slope, 1e-5 * std::abs(slope) + 1e-9 * at.H(row, row)) << k << ", " << i;
    }
}

TEST(Solver, RestAddsItsTwoSpringsAndNothingElse) {
  SyntheticWindow s = make_window({.frames = 5});
  Window& w = *s.window;
  NoVision none;
  Solver solver(best_instruction_set());
  const double cost_without = solver.linearise(w, none, kEverything);
  const Eigen::MatrixXd without = dense(solver.system()).H;
  w.at(3).at_rest = true;
  w.at(3).rest_link = w.at(1).id;
  const double cost_with = solver.linearise(w, none, kEverything);
  const int n = w.size(), a = pose_column(n, 3), b = pose_column(n, 1), v = velocity_row(n, 3);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(without.rows(), without.cols());
  const double velocity = 1 / (0.01 * 0.01), position = 1 / (0.003 * 0.003);
  for (int i = 0; i < 3; ++i) {
    expected(v + i, v + i) = velocity;
    expected(a + i, a + i) = expected(b + i, b + i) = position;
    expected(a + i, b + i) = expected(b + i, a + i) = -position;
  }
  EXPECT_LT((dense(solver.system()).H - without - expected).cwiseAbs().maxCoeff(), 1e-3);
  const double cost = velocity * w.at(3).x.v.squaredNorm() + position * (w.at(3).x.p - w.at(1).x.p).squaredNorm();
  EXPECT_NEAR(cost_with - cost_without, cost, 1e-6 * cost_with);
}

class Elimination : public testing::TestWithParam<std::tuple<InstructionSet, int>> {};

TEST_P(Elimination, GivesTheStepAndTheCovarianceOfADenseSolve) {
  const InstructionSet set = std::get<0>(GetParam());
  if (!runs_here(set)) GTEST_SKIP() << name_of(set) << " is not on this machine";
  SyntheticWindow s = full_window(std::get<1>(GetParam()));
  Window& w = *s.window;
  ASSERT_EQ(w.size(), std::get<1>(GetParam()));
  TrackFactor factor(set);
  factor.collect(w, quadratic(true));
  Solver solver(set);
  solver.linearise(w, factor, kEverything);
  const int n = w.size();
  const DenseSolution reference = solve_dense(dense(solver.system()));
  EXPECT_LT(relative_difference(solve_with(set, solver.system()), reference.step, reference.unit), 1e-8);

  Supervisor supervisor;
  ASSERT_EQ(solver.optimise(w, factor, kEverything, supervisor).accepted, 1);
  std::vector<int> row;  // of the newest state and the time offset
  for (int i = 0; i < 6; ++i) row.push_back(pose_column(n, n - 1) + i);
  for (int i = 0; i < 9; ++i) row.push_back(velocity_row(n, n - 1) + i);
  row.push_back(6 * n);
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      const double scale = std::sqrt(reference.covariance(row[i], row[i]) * reference.covariance(row[j], row[j]));
      EXPECT_NEAR(solver.covariance()(i, j) / scale, reference.covariance(row[i], row[j]) / scale, 1e-6)
          << i << ", " << j;
    }
  for (int i = 0; i < kCalibration; ++i) {
    const double expected = reference.covariance(6 * n + i, 6 * n + i);
    EXPECT_NEAR(solver.calibration_covariance()(i, i), expected, 1e-6 * expected) << "calibration " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Windows, Elimination,
                         testing::Combine(testing::ValuesIn(kInstructionSets), testing::Values(2, 3, 11, 21)));

/// Hours away from the start the position is known to metres only; the damping of the factorisation must not pass for
/// knowledge.
TEST(Solver, DoesNotFlatterTheCovarianceOfAPositionKnownToTenMetres) {
  SyntheticWindow s = make_window({.frames = 11});
  Window& w = *s.window;
  InitialState far;
  far.sigma_p = 10;
  set_initial_prior(w, far, calibration_sigmas());
  TrackFactor factor(best_instruction_set());
  factor.collect(w, quadratic(false));
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  solver.optimise(w, factor, {1, true, false}, supervisor);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::sqrt(solver.covariance()(i, i)), 10, 0.2) << "axis " << i;
}

TEST(Solver, LeavesACalibrationThatIsNotEstimatedAlone) {
  SyntheticWindow s = full_window(5);
  Window& w = *s.window;
  TrackFactor factor(best_instruction_set());
  factor.collect(w, quadratic(false));
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  const Calibration before = w.calibration;
  ASSERT_GT(solver.optimise(w, factor, {3, false, false}, supervisor).accepted, 0);
  EXPECT_TRUE(local(before, w.calibration).isZero(0));
  EXPECT_TRUE(solver.calibration_covariance().isZero(0));
  EXPECT_EQ(solver.covariance()(15, 15), 0);
}

// ---- explicit points ----

/// Bearing residual of the point X (in W), in sigmas, with the body moved by its own velocity and rate to the
/// exposure; the model of docs/derivations/track.md and calibration.md written down directly.
Vec2 bearing_residual(const Observation& o, double inverse_sigma, const NavState& x, const Vec3& v, const Vec3& omega_B,
                      const Calibration& c, double time_offset_used, const Vec3& X) {
  const double dt = c.time_offset - time_offset_used;
  const Mat3 R = x.R * so3_exp(omega_B * dt);
  const Vec3 X_C = c.R_BC.transpose() * (R.transpose() * (X - x.p - v * dt) - c.p_BC);
  return inverse_sigma * (o.chart * X_C / o.f_C.dot(X_C));
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

  Vec2 residual(const TrackRecord& t, int k, const NavState& pose, const Calibration& c, const Vec3& X) const {
    const Slot& s = w.at(k);
    return bearing_residual(w.view(t, k), inverse_sigma, pose, s.x.v, s.omega - s.x.b_g, c, s.time_offset_used, X);
  }
  Vec2 residual(const TrackRecord& t, int k, const Vec3& X) const {
    return residual(t, k, w.at(k).x, w.calibration, X);
  }
  Eigen::MatrixXd by_point(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(3, [&](int i, double h) { return residual(t, k, X + h * Vec3::Unit(i)); });
  }
  Eigen::MatrixXd by_pose(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(6, [&](int i, double h) {
      NavState x = w.at(k).x;
      retract_pose(x, h * Vec6::Unit(i));
      return residual(t, k, x, w.calibration, X);
    });
  }
  Eigen::MatrixXd by_calibration(const TrackRecord& t, int k, const Vec3& X) const {
    return numeric_jacobian(kCalibration, [&](int i, double h) {
      Calibration c = w.calibration;
      retract(c, h * CalibrationTangent::Unit(i));
      return residual(t, k, w.at(k).x, c, X);
    });
  }
  /// The point that fits the bearings best at the current poses: rays first, then Gauss-Newton.
  Vec3 point(const TrackRecord& t) const {
    Mat3 A = Mat3::Zero();
    Vec3 b = Vec3::Zero();
    for (int k = 0; k < w.size(); ++k) {
      if (!w.seen(t, k)) continue;
      const NavState& x = w.at(k).x;
      const Vec3 f = x.R * w.calibration.R_BC * w.view(t, k).f_C, c = x.p + x.R * w.calibration.p_BC;
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
      J.middleCols(pose_column(n, k), 6) = ba.by_pose(t, k, X);
      J.middleCols(6 * n, kCalibration) = ba.by_calibration(t, k, X);
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

// ---- convergence ----

struct Converged {
  double position = 0, attitude = 0, velocity = 0;
  Calibration calibration;
};

Converged optimise_to_the_end(SyntheticWindow& s, const SolverSettings& settings, const CalibrationTangent& sigmas) {
  Window& w = *s.window;
  set_initial_prior(w, {}, sigmas);
  w.prior.x0[0] = s.truth[0];
  TrackFactor factor(best_instruction_set());
  VisualSettings visual;
  visual.extrinsics = settings.estimate_extrinsics;
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  factor.collect(w, visual);
  EXPECT_TRUE(solver.optimise(w, factor, settings, supervisor).solved());
  Converged c;
  c.calibration = w.calibration;
  for (int k = 0; k < w.size(); ++k) {
    const NavState& x = w.at(k).x;
    const NavState& t = s.truth[static_cast<std::size_t>(k)];
    c.position = std::max(c.position, (x.p - t.p).norm());
    c.attitude = std::max(c.attitude, so3_log(t.R.transpose() * x.R).norm());
    c.velocity = std::max(c.velocity, (x.v - t.v).norm());
  }
  return c;
}

TEST(Solver, ConvergesToTheTruthOnPerfectData) {
  SyntheticWindow s = make_window({.frames = 11, .pixel_noise = 0, .state_error = 0.03});
  const Converged c = optimise_to_the_end(s, {20, true, false}, calibration_sigmas());
  EXPECT_LT(c.position, 2e-4);
  EXPECT_LT(c.attitude, 1e-4);
  EXPECT_LT(c.velocity, 1e-3);
  EXPECT_LT(std::abs(c.calibration.time_offset), 5e-5);
}

/// One second of this path says little of the offset (posterior 12 ms): nothing else may be known of it.
TEST(Solver, FindsATimeOffsetOfFiveMilliseconds) {
  SyntheticWindow s = make_window({.frames = 11, .pixel_noise = 0, .time_offset = 5e-3});
  const Converged c = optimise_to_the_end(s, {20, true, false}, CalibrationTangent::Constant(1));
  EXPECT_NEAR(c.calibration.time_offset, 5e-3, 1e-4);
  EXPECT_LT(c.position, 1e-3);
}

TEST(Solver, FindsWhereTheCameraReallyIs) {
  SyntheticWindow s = make_window({.frames = 20, .tracks = 120, .pixel_noise = 0});
  const Calibration truth = s.window->calibration;
  CalibrationTangent error = CalibrationTangent::Zero();
  error << 0, 0.006, -0.008, 0.005, 0.01, -0.008, 0.006;
  retract(s.window->calibration, error);
  const Converged c = optimise_to_the_end(s, {30, true, true}, CalibrationTangent::Constant(1));
  const CalibrationTangent left = local(truth, c.calibration);
  EXPECT_LT(left.segment<3>(1).norm(), 1e-3);
  EXPECT_LT(left.tail<3>().norm(), 1e-3);
}

// ---- deadlines and failures ----

class AlwaysLate final : public Supervisor {
 public:
  bool time_is_up() noexcept override { return true; }
};

TEST(Solver, StopsAfterTheFirstAcceptedStepWhenTimeIsUp) {
  SyntheticWindow hurried = make_window({.state_error = 0.02}), single = make_window({.state_error = 0.02});
  for (SyntheticWindow* s : {&hurried, &single}) set_initial_prior(*s->window, {}, calibration_sigmas());
  TrackFactor factor(best_instruction_set());
  Solver solver(best_instruction_set());
  AlwaysLate late;
  Supervisor patient;
  factor.collect(*single.window, quadratic(false));
  solver.optimise(*single.window, factor, {1, true, false}, patient);
  factor.restart();
  factor.collect(*hurried.window, quadratic(false));
  const SolverSummary r = solver.optimise(*hurried.window, factor, {10, true, false}, late);
  EXPECT_TRUE(r.solved());
  EXPECT_EQ(r.outcome, SolverOutcome::kOutOfTime);
  EXPECT_EQ(r.accepted, 1);
  EXPECT_LT(r.cost, 0.5 * r.cost_first);
  for (int k = 0; k < hurried.window->size(); ++k) {  // the whole of one step, nothing of a second
    EXPECT_EQ(hurried.window->at(k).x.p, single.window->at(k).x.p);
    EXPECT_EQ(hurried.window->at(k).x.R, single.window->at(k).x.R);
    EXPECT_EQ(hurried.window->at(k).x.b_g, single.window->at(k).x.b_g);
  }
  EXPECT_NEAR(solver.linearise(*hurried.window, factor, {10, true, false}), r.cost, 1e-9 * r.cost);
}

/// Works as the track factor does, but that its first linearisation or its trials cost `bad`.
class Failing final : public VisualFactorModel {
 public:
  enum class At { kLinearisation, kTrial };
  Failing(At at, double bad) : track_(best_instruction_set()), at_(at), bad_(bad) {}
  void collect(const Window& w, const VisualSettings& s) noexcept override { track_.collect(w, s); }
  void linearise(const Window& w, VisualSystem& out) noexcept override {
    track_.linearise(w, out);
    if (at_ == At::kLinearisation) out.cost = bad_;
  }
  double cost(const Window& w) noexcept override { return at_ == At::kTrial ? bad_ : track_.cost(w); }
  void marginalise_oldest(const Window& w, const VisualSettings& s, VisualSystem& out) noexcept override {
    track_.marginalise_oldest(w, s, out);
  }

 private:
  TrackFactor track_;
  At at_;
  double bad_;
};

TEST(Solver, PutsTheStateBackExactlyWhenAStepIsRejected) {
  for (const double bad : {1e12, std::nan(""), std::numeric_limits<double>::infinity()}) {
    SyntheticWindow s = make_window({});
    Window& w = *s.window;
    set_initial_prior(w, {}, calibration_sigmas());
    std::vector<NavState> before;
    for (int k = 0; k < w.size(); ++k) before.push_back(w.at(k).x);
    const Calibration calibration = w.calibration;
    Failing factor(Failing::At::kTrial, bad);
    Solver solver(best_instruction_set());
    Supervisor supervisor;
    factor.collect(w, quadratic(true));
    const SolverSummary r = solver.optimise(w, factor, kEverything, supervisor);
    EXPECT_EQ(r.outcome, SolverOutcome::kGaveUp);
    EXPECT_FALSE(r.solved());
    EXPECT_EQ(r.accepted, 0);
    EXPECT_GT(r.rejected, 1);
    for (int k = 0; k < w.size(); ++k) {
      const NavState& x = w.at(k).x;
      const NavState& y = before[static_cast<std::size_t>(k)];
      EXPECT_TRUE(x.p == y.p && x.R == y.R && x.v == y.v && x.b_a == y.b_a && x.b_g == y.b_g) << "frame " << k;
    }
    EXPECT_TRUE(w.calibration.time_offset == calibration.time_offset && w.calibration.R_BC == calibration.R_BC &&
                w.calibration.p_BC == calibration.p_BC);
  }
}

TEST(Solver, ReportsACostThatIsNotANumber) {
  SyntheticWindow s = make_window({});
  set_initial_prior(*s.window, {}, calibration_sigmas());
  Failing factor(Failing::At::kLinearisation, std::nan(""));
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  factor.collect(*s.window, quadratic(false));
  EXPECT_EQ(solver.optimise(*s.window, factor, {3, true, false}, supervisor).outcome, SolverOutcome::kNotFinite);
}

/// In a window whose velocity is off by 0.3 m/s, every step being refused: nothing of the solver's may be taken for
/// knowledge.
TEST(Solver, HandsOutNoCovarianceWhenItGivesUp) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  for (int k = 0; k < w.size(); ++k) w.at(k).x.v += Vec3(0.3, 0, 0);
  Failing factor(Failing::At::kTrial, 1e12);
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  factor.collect(w, quadratic(false));
  const SolverSummary r = solver.optimise(w, factor, {3, true, false}, supervisor);
  EXPECT_EQ(r.outcome, SolverOutcome::kGaveUp);
  EXPECT_TRUE(r.failed());
  EXPECT_EQ(r.rejected, Solver::kMostAttempts);
}

/// Half of the tracks jump to and fro; the gate stands back and none is dropped, but they are counted, and the trial
/// step must not forget them.
TEST(Solver, CountsTheTracksThatContradictTheMotionWhenNoneIsDropped) {
  SyntheticWindow s = make_window({.frames = 8, .tracks = 120});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  for (int i = 0; i < w.track_count(); i += 2)
    for (int k = 0; k < w.size(); ++k)
      if (w.seen(w.track(i), k)) {
        Observation& o = w.view(w.track(i), k);
        const Mat3 Q = so3_exp(0.05 * (k % 2 ? 1 : -1) * o.f_C.unitOrthogonal());
        o.f_C = Q * o.f_C;
        o.chart = o.chart * Q.transpose();
      }
  TrackFactor factor(best_instruction_set());
  VisualSettings settings;
  factor.collect(w, settings);
  Solver solver(best_instruction_set());
  Supervisor supervisor;
  const SolverSummary r = solver.optimise(w, factor, {1, true, false}, supervisor);
  EXPECT_TRUE(factor.gate_suspended());
  EXPECT_GT(r.gated, 0.4 * r.tracks);
}

/// Where the points start from is no part of what is found.
TEST(Solver, TheStepDoesNotDependOnWhereThePointsWereFoundBefore) {
  SyntheticWindow cold = make_window({.frames = 8, .tracks = 80}), warm = make_window({.frames = 8, .tracks = 80});
  VisualSettings settings = quadratic(false);
  settings.inner_steps = 30;
  TrackFactor from_afar(best_instruction_set()), from_nearby(best_instruction_set());
  // the second one has found its points before, with all poses off by centimetres
  std::vector<NavState> keep;
  for (int k = 0; k < warm.window->size(); ++k) {
    keep.push_back(warm.window->at(k).x);
    warm.window->at(k).x.p += 0.02 * Vec3(std::sin(k), std::cos(2 * k), 0.3 * k);
  }
  Solver solver(best_instruction_set());
  from_nearby.collect(*warm.window, settings);
  solver.linearise(*warm.window, from_nearby, kEverything);
  for (int k = 0; k < warm.window->size(); ++k) warm.window->at(k).x = keep[static_cast<std::size_t>(k)];
  DenseSolution step[2];
  for (SyntheticWindow* s : {&cold, &warm}) {
    TrackFactor& factor = s == &cold ? from_afar : from_nearby;
    set_initial_prior(*s->window, {}, calibration_sigmas());
    factor.collect(*s->window, settings);
    solver.linearise(*s->window, factor, kEverything);
    step[s == &warm] = solve_dense(dense(solver.system()));
  }
  EXPECT_LT(relative_difference(step[1].step, step[0].step, step[0].unit), 1e-6);
}

}  // namespace
}  // namespace epiline
