// What marginalisation hands on: never negative information, nothing about directions nothing can see, and exactly what
// the full problem knew wherever that can be kept. Derivation: docs/derivations/marginalisation.md.
#include "estimator/solver/marginalise.h"

#include <gtest/gtest.h>

#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "tests/estimator/any_factor.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/factors/explicit_residuals.h"
#include "tests/estimator/solver/solver_fixture.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VisualSettings settings() {
  VisualSettings s;
  s.gate = false;
  s.extrinsics = true;
  return s;
}

// ---- H_add; more of it: tests/estimator/factors/drift_test.cc ----

/// Two numbers a bearing: what one frame of n tracks adds has rank 2n at most.
TEST(AddedInformation, OfThreeTracksHasRankSix) {
  SyntheticWindow s = make_window({.tracks = 3});
  TrackFactor factor(best_instruction_set());
  const auto added = std::make_unique<VisualSystem>();
  factor.collect(*s.window, settings());
  factor.marginalise_oldest(*s.window, settings(), *added);
  const MatrixXd H = dense(*added, s.window->size() - 1);
  const VectorXd e = eigenvalues(H).reverse();
  EXPECT_GT(e[5], 1e-7 * e[0]);
  EXPECT_LT(std::abs(e[6]), 1e-10 * e[0]);
}

// ---- gauge ----

/// Translations and the turn about gravity, in the prior's tangent.
MatrixXd gauge(const Window& w) {
  const Prior& p = w.prior;
  const Vec3 z(0, 0, 1);
  MatrixXd N = MatrixXd::Zero(p.dim(), 4);
  for (int k = 0; k < p.frames; ++k) {
    const NavState& x = p.x0[static_cast<std::size_t>(k)];
    for (int i = 0; i < 3; ++i) N(6 * k + i, i) = 1;
    N.block<3, 1>(6 * k, 3) = z.cross(x.p);
    N.block<3, 1>(6 * k + 3, 3) = x.R.transpose() * z;
  }
  N.block<3, 1>(6 * p.frames, 3) = z.cross(p.x0[0].v);
  return N;
}

TEST(Marginalisation, KnowsNothingOfWhereAndWhichWayWhenNothingAnchorsTheWindow) {
  SyntheticWindow s = make_window({.frames = 11, .tracks = 200});
  Window& w = *s.window;
  TrackFactor factor(best_instruction_set());
  VisualSettings visual = settings();
  visual.extrinsics = false;
  Marginaliser marginaliser(best_instruction_set());
  for (int round = 0; round < 5; ++round) {  // one IMU interval alone tells neither scale nor tilt nor biases
    factor.collect(w, visual);
    marginaliser.marginalise_oldest(w, factor, visual);
  }
  const MatrixXd H = dense_prior(w.prior), N = gauge(w);
  for (int c = 0; c < 4; ++c)
    EXPECT_LT(std::abs(congruence(H, N.col(c))(0, 0)) / (H.norm() * N.col(c).squaredNorm()), 1e-14)
        << "direction " << c;
  // and of everything else it knows something: poses, velocity, biases (the six extrinsics are off)
  const int known = w.prior.calibration_row();
  const MatrixXd known_H = H.topLeftCorner(known, known);
  const VectorXd e = eigenvalues(in_units(known_H, units(known_H)));
  EXPECT_LT(e.head(4).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_GT(e[4], 1e-8);
}

// ---- exactness ----

/// Steps of the frames 1..n-1 and the calibration, first of the full problem, then after marginalising frame 0.
struct Steps {
  VectorXd full, reduced, unit;
};

Steps steps_before_and_after(Window& w, VisualFactorModel& visual, const VisualSettings& settings) {
  const SolverSettings everything{1, true, true};
  Solver solver(best_instruction_set());
  visual.collect(w, settings);
  solver.linearise(w, visual, everything);
  const int n = w.size();
  const DenseSolution before = solve_dense(dense(solver.system()));
  visual.restart();  // every time from the closed form: the same points
  Marginaliser(best_instruction_set()).marginalise_oldest(w, visual, settings);
  visual.restart();
  visual.collect(w, settings);
  solver.linearise(w, visual, everything);
  const DenseSolution after = solve_dense(dense(solver.system()));
  const int m = n - 1;
  Steps s;
  s.reduced = after.step;
  s.full.resize(after.step.size());
  s.unit.resize(after.step.size());
  auto take = [&](int to, int from, int count) {
    s.full.segment(to, count) = before.step.segment(from, count);
    s.unit.segment(to, count) = after.covariance.diagonal().segment(to, count).cwiseSqrt().cwiseInverse();
  };
  for (int k = 0; k < m; ++k) {
    take(pose_column(k), pose_column(k + 1), 6);
    take(velocity_row(m, k), velocity_row(n, k + 1), 9);
  }
  take(calibration_column(m), calibration_column(n), kCalibration);
  return s;
}

TEST(Marginalisation, LosesNothingOfImuPriorRestAndWheels) {
  SyntheticWindow s = make_window({.state_error = 0.01});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  w.prior.x0[0] = s.truth[0];
  w.at(0).at_rest = w.at(3).at_rest = true;
  w.at(3).rest_link = w.at(0).id;
  furnish_wheels(w);
  NoVision none;
  for (int round = 0; round < 3; ++round) {  // from the second on, the prior is one that marginalisation made
    const Steps steps = steps_before_and_after(w, none, settings());
    EXPECT_GT(steps.unit.cwiseProduct(steps.full).norm(), 1e-3);
    EXPECT_LT(relative_difference(steps.reduced, steps.full, steps.unit), 1e-6) << "round " << round;
  }
}

/// A track of two views says all it has to say at once; here frame 0 shares such tracks with the frames that stay.
TEST(Marginalisation, LosesNothingOfTracksOfTwoViews) {
  SyntheticWindow s = make_window({.tracks = 100, .state_error = 0.01});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    const int partner = 1 + i % (w.size() - 2);
    t.mask &= i % 2 ? w.bit(0) | w.bit(partner) : w.bit(partner) | w.bit(w.size() - 1);
  }
  TrackFactor factor(best_instruction_set());
  const Steps steps = steps_before_and_after(w, factor, settings());
  EXPECT_LT(relative_difference(steps.reduced, steps.full, steps.unit), 1e-6);
}

TEST(Marginalisation, TakesTheFrameOut) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  w.at(2).at_rest = true;
  w.at(2).rest_link = w.at(0).id;
  const int n = w.size();
  const std::uint64_t second = w.at(1).id;
  TrackFactor factor(best_instruction_set());
  factor.collect(w, settings());
  Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, settings());
  ASSERT_EQ(w.size(), n - 1);
  EXPECT_EQ(w.at(0).id, second);
  EXPECT_EQ(w.prior.frames, n - 2);
  EXPECT_EQ(w.at(1).rest_link, 0u);
  EXPECT_TRUE(w.at(1).at_rest);
}

/// What is handed on does not depend on frames that may still be dropped: they would take with them what the prior
/// knows through their poses.
TEST(Marginalisation, FramesThatMayBeDroppedTakeNoPart) {
  for (const TrackNoiseModel noise : {TrackNoiseModel::kDrift, TrackNoiseModel::kWhite}) {
    VisualSettings visual = settings();
    visual.noise = noise;
    visual.inner_steps = 20;  // eight tracks end together, and others share a batch here and there
    visual.converged = 1e-9;
    Prior priors[2];
    for (const bool without : {false, true}) {
      SyntheticWindow s = make_window({.frames = 10, .tracks = 100});
      Window& w = *s.window;
      set_initial_prior(w, {}, calibration_sigmas());
      for (int k = 6; k < 9; ++k) w.at(k).stays = false;
      if (without)
        for (int i = 0; i < 3; ++i) w.remove(w.size() - 1);
      TrackFactor factor(best_instruction_set());
      factor.collect(w, visual);
      Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, visual);
      priors[without] = w.prior;
    }
    ASSERT_EQ(priors[0].frames, 5);
    ASSERT_EQ(priors[1].frames, 5);
    EXPECT_LT(relative_difference(dense_prior(priors[0]), dense_prior(priors[1])), 1e-6);
    EXPECT_LT(relative_difference(dense_prior_rhs(priors[0]), dense_prior_rhs(priors[1])), 1e-6);
  }
}

TEST(Marginalisation, OfTheTrackFactorKeepsThePriorPositive) {
  TrackFactor factor(best_instruction_set());
  expect_prior_stays_positive(factor);
}

// ---- what may have moved ----

std::unique_ptr<SyntheticWindow> with_prior() {
  auto s = std::make_unique<SyntheticWindow>(make_window({}));
  set_initial_prior(*s->window, {}, calibration_sigmas());
  TrackFactor factor(best_instruction_set());
  factor.collect(*s->window, settings());
  Marginaliser(best_instruction_set()).marginalise_oldest(*s->window, factor, settings());
  return s;
}
DenseSolution solved(const Prior& p) { return solve_dense({dense_prior(p), dense_prior_rhs(p)}); }

TEST(Inflate, AddsTheVarianceAndLeavesTheEstimate) {
  const auto s = with_prior();
  Prior& p = s->window->prior;
  for (const int row : {p.calibration_row(), p.calibration_row() + 6, p.calibration_row() - 3}) {
    const DenseSolution before = solved(p);
    const Vec3 moved = Vec3(2, -1, 0.5) * std::sqrt(before.covariance(row, row));
    inflate(p, row, {moved.data(), 3});
    const DenseSolution after = solved(p);
    MatrixXd expected = before.covariance;
    expected.block<3, 3>(row, row) += moved * moved.transpose();
    EXPECT_LT(scaled_difference(after.covariance, expected), 1e-6);
    EXPECT_LT(scaled_difference(after.step, before.step, expected), 1e-6);
  }
}

TEST(Inflate, DoesNothingWithoutAPriorOrAMotion) {
  const auto p = std::make_unique<Prior>();
  p->frames = 0;
  const double still = 0, moved = 1;
  inflate(*p, 0, {&moved, 1});
  EXPECT_EQ(p->frames, 0);
  SyntheticWindow s = make_window({});
  set_initial_prior(*s.window, {}, calibration_sigmas());
  const MatrixXd before = dense_prior(s.window->prior);
  inflate(s.window->prior, s.window->prior.calibration_row(), {&still, 1});
  EXPECT_EQ((dense_prior(s.window->prior) - before).norm(), 0);
}

constexpr SolverSettings kAllEstimated{2, true, true, true, true};

/// Moves the window to where the prior holds it best, but for `by` from row `at` on.
void move_from_prior(Window& w, int at, const Vec3& by) {
  Prior& p = w.prior;
  const MatrixXd H = dense_prior(p);
  Eigen::VectorXd d = Eigen::VectorXd::Zero(p.dim());
  d.segment<3>(at) = by;
  const Eigen::VectorXd b = H * -d;  // the window stands at 0
  for (int i = 0; i < p.dim(); ++i) p.b[i] = b[i];
  for (int k = 0; k < p.frames; ++k) p.x0[static_cast<std::size_t>(k)] = w.at(k).x;
  p.c0 = w.calibration;
}

// The most likely walk of n numbers that are seen to be d off, with d'P^-1 d = c: P + d d' (1 / n - 1 / c).
TEST(LetStep, ForgetsOfTheGyroscopesBiasWhatContradicts) {
  const auto s = with_prior();
  Window& w = *s->window;
  const int row = w.prior.calibration_row() - 3;
  const MatrixXd before = solved(w.prior).covariance;
  const Mat3 P = before.block<3, 3>(row, row);
  for (const double sigmas : {1., 5.}) {  // c: their square
    const Vec3 unit = P.llt().matrixL() * Vec3(1, 1, -1).normalized(), by = sigmas * unit;
    move_from_prior(w, row, by);
    Marginaliser(best_instruction_set()).let_step(w, kAllEstimated);
    MatrixXd expected = before;
    if (sigmas > 2) expected.block<3, 3>(row, row) += (1. / 3 - 1 / (sigmas * sigmas)) * by * by.transpose();
    const DenseSolution after = solved(w.prior);
    EXPECT_LT(scaled_difference(after.covariance, expected), 1e-4) << sigmas;
    EXPECT_NEAR((after.step.segment<3>(row) + by).norm() / by.norm(), 0, 1e-4);
  }
}

TEST(LetStep, ForgetsTheTimeOffsetOnceAllOfThePriorIsContradicted) {
  for (const double of_all : {0.9, 1.1}) {  // squared sigmas on the mean
    const auto s = with_prior();
    Window& w = *s->window;
    const int row = w.prior.calibration_row() + kTimeOffsetColumn;
    const double P = solved(w.prior).covariance(row, row),
                 squared = of_all * w.prior.dim() / dense_prior(w.prior)(row, row);
    move_from_prior(w, row, Vec3(std::sqrt(squared), 0, 0));
    Marginaliser(best_instruction_set()).let_step(w, kAllEstimated);
    EXPECT_NEAR(solved(w.prior).covariance(row, row) / (of_all > 1 ? squared : P), 1, 1e-4) << of_all;
  }
}

TEST(LetStep, LeavesATimeOffsetThatIsNotEstimated) {
  const auto s = with_prior();
  Window& w = *s->window;
  const int row = w.prior.calibration_row() + kTimeOffsetColumn;
  move_from_prior(w, row, Vec3(1, 0, 0));
  const MatrixXd before = dense_prior(w.prior);
  Marginaliser(best_instruction_set()).let_step(w, {2, false, true, true, true});
  EXPECT_EQ((dense_prior(w.prior) - before).row(row).norm(), 0);
}

// ---- the first prior ----

TEST(InitialPrior, TellsTiltFromYaw) {
  SyntheticWindow s = make_window({.state_error = 0.3});
  Window& w = *s.window;
  InitialState sigmas;
  sigmas.sigma_tilt = 0.02;
  sigmas.sigma_yaw = 0.5;
  set_initial_prior(w, sigmas, calibration_sigmas());
  const MatrixXd C = inverse(dense_prior(w.prior));
  const Mat3 R = w.at(0).x.R;
  const Mat3 world = R * C.block<3, 3>(3, 3) * R.transpose();
  const Vec3 expected(0.02 * 0.02, 0.02 * 0.02, 0.5 * 0.5);
  EXPECT_TRUE(world.isApprox(Mat3(expected.asDiagonal()), 1e-9)) << world;
  EXPECT_NEAR(C(6, 6), sigmas.sigma_v * sigmas.sigma_v, 1e-12);
  EXPECT_NEAR(C(15, 15), 25e-6, 1e-12);
}

}  // namespace
}  // namespace epiline::test
