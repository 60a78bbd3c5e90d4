// The solver against dense linear algebra and against the truth. Derivation: docs/derivations/solver.md.
#include "estimator/solver/solver.h"

#include <gtest/gtest.h>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/solver/solver_fixture.h"

namespace epiline::test {
namespace {

/// Prior, IMU, rest and wheels: the right-hand side is the slope of the cost.
TEST(Solver, GradientMatchesCentralDifferencesOfTheCost) {
  SyntheticWindow s = full_window(5);
  Window& w = *s.window;
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
      const int row = i < 6 ? pose_column(k) + i : velocity_row(n, k) + i - 6;
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
  const int n = w.size(), a = pose_column(3), b = pose_column(1), v = velocity_row(n, 3);
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

/// The elimination skips those columns, and nobody clears them.
TEST(Solver, NoFactorWritesInFrontOfWhatABlockOfTheChainMeets) {
  SyntheticWindow s = full_window(9);
  const Window& w = *s.window;
  TrackFactor factor(best_instruction_set());
  factor.collect(w, quadratic(true));
  Solver solver(best_instruction_set());
  LinearSystem& system = solver.system();
  constexpr double kUntouched = 12345;
  for (auto& block : system.P)
    for (auto& row : block) std::fill(std::begin(row), std::end(row), kUntouched);
  solver.linearise(w, factor, kEverything);
  for (int k = 0; k < w.size() - 1; ++k)
    for (const auto& row : system.P[k]) {
      for (int c = 0; c < first_met(k); ++c) ASSERT_EQ(row[c], kUntouched) << k << ", " << c;
      for (int c = first_met(k); c < dense_dim(w.size()); ++c) ASSERT_NE(row[c], kUntouched) << k << ", " << c;
    }
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
  for (int i = 0; i < 6; ++i) row.push_back(pose_column(n - 1) + i);
  for (int i = 0; i < 9; ++i) row.push_back(velocity_row(n, n - 1) + i);
  row.push_back(calibration_column(n));
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      const double scale = std::sqrt(reference.covariance(row[i], row[i]) * reference.covariance(row[j], row[j]));
      EXPECT_NEAR(solver.covariance()(i, j) / scale, reference.covariance(row[i], row[j]) / scale, 1e-6)
          << i << ", " << j;
    }
  for (int i = 0; i < kCalibration; ++i) {
    const int c = calibration_column(n) + i;
    const double expected = reference.covariance(c, c);
    EXPECT_NEAR(solver.calibration_covariance()(i, i), expected, 1e-6 * expected) << "calibration " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Windows, Elimination,
                         testing::Combine(testing::ValuesIn(kInstructionSets), testing::Values(1, 2, 3, 11, 21)));

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
  visual.lens = settings.estimate_focal_length;
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

TEST(Solver, SaysWhatTheImuCosts) {
  for (const double off : {0.0, 0.3}) {  // m/s^2, of a bias that the readings do not show
    SyntheticWindow s = make_window({.frames = 11, .pixel_noise = 0.5});
    Window& w = *s.window;
    for (int k = 0; k < w.size(); ++k) w.at(k).x.b_a = Vec3(0, k % 2 ? off : -off, 0);
    TrackFactor factor(best_instruction_set());
    factor.collect(w, quadratic(false));
    Solver solver(best_instruction_set());
    Supervisor patient;
    double imu_cost = -1;
    for (int i = 0; i < 20; ++i) imu_cost = solver.optimise(w, factor, {1, false, false}, patient).imu_cost;
    double cost = 0;
    for (int k = 1; k < w.size(); ++k) {
      const Vec15 r = imu_residual(w.at(k).imu, w.calibration.scale, w.at(k - 1).x, w.at(k).x);
      cost += chi2(r, w.at(k).imu.C);
    }
    EXPECT_NEAR(imu_cost, cost, 1e-3 * cost);
  }
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
  error << 0, 0.006, -0.008, 0.005, 0.01, -0.008, 0.006, 0, 0, 0;
  retract(s.window->calibration, error);
  const Converged c = optimise_to_the_end(s, {30, true, true}, CalibrationTangent::Constant(1));
  const CalibrationTangent left = local(truth, c.calibration);
  EXPECT_LT(left.segment<3>(kRotationColumn).norm(), 1e-3);
  EXPECT_LT(left.segment<3>(kTranslationColumn).norm(), 1e-3);
}

/// Bearings of a lens taken to be 3 % shorter than it is.
TEST(Solver, FindsTheFocalLength) {
  SyntheticWindow s = make_window({.frames = 20, .tracks = 120, .pixel_noise = 0});
  Window& w = *s.window;
  for (int i = 0; i < w.track_count(); ++i)
    for (int k = 0; k < w.size(); ++k) {
      if (!w.seen(w.track(i), k)) continue;
      Observation& view = w.view(w.track(i), k);
      const Vec3 before = bearing_of(view);
      const Vec2 z = before.head<2>() / before.z() / 0.97;
      const Vec3 f_C = z.homogeneous().normalized();
      const double F = 0.97 * kFocal / f_C.z();
      set_view(f_C, (Mat23() << F, 0, -F * z.x(), 0, F, -F * z.y()).finished(), view);
    }
  const Converged c = optimise_to_the_end(s, {30, true, false, true}, CalibrationTangent::Constant(1));
  EXPECT_NEAR(c.calibration.focal_ratio(), 1 / 0.97, 1e-4);
  EXPECT_LT(c.position, 2e-3);
}

/// Readings of a sensor that shows 3 % too much.
TEST(Solver, FindsTheScalesOfTheImu) {
  for (const ImuScale scale : {ImuScale{0.03, 0}, ImuScale{0, -0.03}}) {
    SyntheticWindow s = make_window({.frames = 20, .tracks = 120, .pixel_noise = 0, .imu_scale = scale});
    const Converged c = optimise_to_the_end(s, {30, true, false, false, true}, CalibrationTangent::Constant(1));
    EXPECT_NEAR(c.calibration.scale.accelerometer, scale.accelerometer, 1e-3);
    EXPECT_NEAR(c.calibration.scale.gyroscope, scale.gyroscope, 1e-4);
    EXPECT_LT(c.position, 5e-3);
  }
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

/// The track factor, with its trials counted; whether it may do without them is the test's.
class Counted final : public VisualFactorModel {
 public:
  explicit Counted(bool may_step_untried) : may_(may_step_untried) {}
  void collect(const Window& w, const VisualSettings& settings) noexcept override { track_.collect(w, settings); }
  void linearise(const Window& w, VisualSystem& out) noexcept override { track_.linearise(w, out); }
  double cost(const Window& w) noexcept override {
    ++trials;
    return track_.cost(w);
  }
  void marginalise_oldest(const Window& w, const VisualSettings& settings, VisualSystem& out) noexcept override {
    track_.marginalise_oldest(w, settings, out);
  }
  bool may_step_untried() const noexcept override { return may_; }
  int trials = 0;

 private:
  TrackFactor track_{best_instruction_set()};
  bool may_;
};

/// A short step may cost trials that nobody needs; a factor whose cost does not keep to its quadratic model needs them.
TEST(Solver, TriesShortStepsUnlessTheFactorDoesWithout) {
  for (const bool may : {false, true}) {
    SyntheticWindow s = make_window({.frames = 8, .tracks = 80, .pixel_noise = 0, .state_error = 0.01});
    set_initial_prior(*s.window, {}, calibration_sigmas());
    Counted factor(may);
    Solver solver(best_instruction_set());
    Supervisor patient;
    factor.collect(*s.window, quadratic(false));
    ASSERT_TRUE(solver.optimise(*s.window, factor, {20, true, false}, patient).solved());
    factor.trials = 0;
    ASSERT_TRUE(solver.optimise(*s.window, factor, {20, true, false}, patient).solved());  // nothing is left to gain
    EXPECT_EQ(factor.trials > 0, !may);
  }
  EXPECT_TRUE(TrackFactor(best_instruction_set()).may_step_untried());
}

}  // namespace
}  // namespace epiline::test
