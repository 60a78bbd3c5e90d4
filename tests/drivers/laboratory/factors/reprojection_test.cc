// The reprojection factor against the same problem written down directly, its depths explicit and its Jacobians
// numerical; what becomes of depths from frame to frame. Derivation: docs/derivations/reprojection.md.
#include "drivers/laboratory/factors/reprojection.h"

#include <gtest/gtest.h>

#include "estimator/factors/prior.h"
#include "estimator/solver/marginalise.h"
#include "tests/drivers/laboratory/factors/explicit_depths.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/solver/solver_fixture.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VisualSettings reprojection_settings() {
  VisualSettings s;
  s.extrinsics = true;
  return s;
}

class Sets : public testing::TestWithParam<InstructionSet> {};

/// Good and wild bearings (Huber's weights), wrong depths, the clock off: cost, H and b with the depths eliminated.
TEST_P(Sets, LinearisationIsTheSchurComplementOfExplicitDepths) {
  const InstructionSet set = GetParam();
  if (!runs_here(set)) GTEST_SKIP() << name_of(set) << " is not on this machine";
  for (const double noise : {0.5, 4.0}) {
    SyntheticWindow s = make_window({.frames = 6, .tracks = 37, .pixel_noise = noise, .state_error = 0.01});
    Window& w = *s.window;
    w.calibration.time_offset = 2e-3;
    ReprojectionFactor factor(set);
    const auto system = std::make_unique<VisualSystem>();
    factor.collect(w, reprojection_settings());
    for (int i = 0; i < w.track_count(); ++i) factor.landmark(i).inverse_distance *= 1 + 0.05 * std::sin(i);
    factor.linearise(w, *system);
    const Explicit reference(w, factor, w.size());
    EXPECT_EQ(system->tracks, reference.landmarks());
    EXPECT_EQ(factor.unknowns(), reference.landmarks());
    EXPECT_NEAR(system->cost, reference.cost, 1e-10 * reference.cost);
    EXPECT_NEAR(factor.cost(w), reference.cost, 1e-10 * reference.cost);
    const MatrixXd H = reference.reduced_H();
    EXPECT_LT(scaled_difference(dense(*system, w.size()), H), 1e-7);
    EXPECT_LT(scaled_difference(dense_rhs(*system, w.size()), reference.reduced_b(), H), 1e-7);
  }
}

INSTANTIATE_TEST_SUITE_P(InstructionSets, Sets, testing::ValuesIn(kInstructionSets));

/// The same flight with the camera's axes turned, so that most bearings have z <= 0: nothing may change.
TEST(ReprojectionFactor, DoesNotCareWhichWayTheOpticalAxisPoints) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  VisualSettings visual;
  const auto before = std::make_unique<VisualSystem>(), after = std::make_unique<VisualSystem>();
  ReprojectionFactor factor(best_instruction_set()), turned(best_instruction_set());
  factor.collect(w, visual);
  factor.linearise(w, *before);
  const Mat3 Q = so3_exp(Vec3(0.2, 2.5, 0.1));
  w.calibration.R_BC = w.calibration.R_BC * Q.transpose();
  for (int i = 0; i < w.track_count(); ++i)
    for (int k = 0; k < w.size(); ++k) {
      if (!w.seen(w.track(i), k)) continue;
      Observation& o = w.view(w.track(i), k);
      set_view(Q * bearing_of(o), chart_of(o) * Q.transpose(), o);
    }
  turned.collect(w, visual);
  turned.linearise(w, *after);
  // a view has seven digits
  EXPECT_NEAR(after->cost, before->cost, 1e-5 * before->cost);
  EXPECT_LT(relative_difference(dense(*after, w.size()), dense(*before, w.size())), 1e-6);
}

/// Landmarks and poses move together: the solver's step is that of the problem with every depth in it.
TEST(ReprojectionFactor, StepOfPosesAndDepthsIsThatOfTheJointProblem) {
  SyntheticWindow s = make_window({.frames = 6, .tracks = 30, .state_error = 1e-3});
  Window& w = *s.window;
  CalibrationTangent sigmas;
  sigmas << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.01), 0.01, 0.01, 0.01;
  set_initial_prior(w, {}, sigmas);
  const SolverSettings everything{.steps = 1, .estimate_time_offset = true, .estimate_extrinsics = true};
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  Solver solver(best_instruction_set());
  solver.linearise(w, factor, everything);
  const DenseSystem reduced = dense(solver.system());
  const auto visual = std::make_unique<VisualSystem>(solver.visual_system());

  // the inertial part is what remains when the reduced visual part is taken away; to it the joint one is added
  const int n = w.size(), states = static_cast<int>(reduced.b.size());
  const Explicit joint(w, factor, n);
  MatrixXd T = MatrixXd::Zero(joint.states(), states);  // world turns of all poses, oldest first, in the solver's order
  for (int k = 0; k < n; ++k) {
    T.block<3, 3>(6 * k, pose_column(k)) = Mat3::Identity();
    T.block<3, 3>(6 * k + 3, pose_column(k) + 3) = w.at(k).x.R;
  }
  T.block<kCameraCalibration, kCameraCalibration>(6 * n, calibration_column(n)).setIdentity();
  const int m = joint.landmarks();
  DenseSystem full{MatrixXd::Zero(states + m, states + m), VectorXd::Zero(states + m)};
  full.H.topLeftCorner(states, states) =
      reduced.H + congruence(joint.H.topLeftCorner(joint.states(), joint.states()) - dense(*visual, n), T);
  full.H.topRightCorner(states, m) = product(T.transpose(), joint.H.topRightCorner(joint.states(), m));
  full.H.bottomLeftCorner(m, states) = full.H.topRightCorner(states, m).transpose();
  full.H.bottomRightCorner(m, m) = joint.H.bottomRightCorner(m, m);
  full.b.head(states) = reduced.b + product(T.transpose(), joint.b.head(joint.states()) - dense_rhs(*visual, n));
  full.b.tail(m) = joint.b.tail(m);
  const DenseSolution reference = solve_dense(full);

  Supervisor supervisor;
  std::vector<NavState> before;
  for (int k = 0; k < n; ++k) before.push_back(w.at(k).x);
  ASSERT_EQ(solver.optimise(w, factor, everything, supervisor).accepted, 1);
  VectorXd poses(6 * n), depths(m);
  VectorXd poses_expected(6 * n);
  for (int k = 0; k < n; ++k) {
    poses.segment<6>(6 * k) = local_pose(before[static_cast<std::size_t>(k)], w.at(k).x);
    poses_expected.segment<6>(6 * k) = reference.step.segment<6>(pose_column(k));
  }
  for (int i = 0; i < m; ++i)
    depths[i] = factor.landmark(joint.track(i)).inverse_distance - joint.rho[static_cast<std::size_t>(i)];
  EXPECT_LT(relative_difference(poses, poses_expected), 1e-6);
  EXPECT_GT(depths.norm(), 1e-4);
  EXPECT_LT(relative_difference(reference.step.tail(m), depths), 1e-3);  // cameras turn about bodies on arcs
}

TEST(ReprojectionFactor, ARejectedStepTakesTheDepthsBack) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  ReprojectionFactor factor(best_instruction_set());
  const auto system = std::make_unique<VisualSystem>();
  factor.collect(w, reprojection_settings());
  factor.linearise(w, *system);
  const double cost = system->cost, rho = factor.landmark(3).inverse_distance;
  const NavState keep = w.at(2).x;
  factor.save();
  w.at(2).x.p += Vec3(0.3, -0.2, 0.1);
  factor.step(w);
  EXPECT_NE(factor.landmark(3).inverse_distance, rho);
  w.at(2).x = keep;
  factor.restore();
  EXPECT_EQ(factor.landmark(3).inverse_distance, rho);
  factor.linearise(w, *system);
  EXPECT_EQ(system->cost, cost);
}

// ---- from frame to frame ----

TEST(ReprojectionFactor, ANewLandmarkIsTriangulatedAndThenKept) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0});
  Window& w = *s.window;
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  const auto system = std::make_unique<VisualSystem>();
  factor.linearise(w, *system);
  EXPECT_LT(system->cost, 1e-6);  // bearings perfect to 1e-4 sigmas, perfect poses: perfect depths
  factor.landmark(5).inverse_distance = 0.123;
  factor.collect(w, reprojection_settings());
  EXPECT_EQ(factor.landmark(5).inverse_distance, 0.123);
  factor.restart();
  factor.collect(w, reprojection_settings());
  EXPECT_NE(factor.landmark(5).inverse_distance, 0.123);
}

TEST(ReprojectionFactor, LandmarksOfALeavingHostStayWhereTheyAre) {
  SyntheticWindow s = make_window({.frames = 8, .tracks = 60, .pixel_noise = 0});
  Window& w = *s.window;
  set_initial_prior(w, {}, CalibrationTangent::Constant(0.01));
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  std::vector<Vec3> points;
  for (int i = 0; i < w.track_count(); ++i) {
    factor.landmark(i).inverse_distance *= 1.1;  // as if estimated: no triangulation would give it
    int h = 0;
    while (!w.seen(w.track(i), h)) ++h;
    ASSERT_EQ(factor.landmark(i).host, w.at(h).id);
    const Camera c = camera(w, h);
    points.push_back(c.c + c.R * bearing_of(w.view(w.track(i), h)) / factor.landmark(i).inverse_distance);
  }
  Marginaliser(best_instruction_set()).marginalise_oldest(w, factor, reprojection_settings());
  factor.collect(w, reprojection_settings());
  for (int i = 0; i < w.track_count(); ++i) {
    int h = 0;
    while (!w.seen(w.track(i), h)) ++h;
    ASSERT_EQ(factor.landmark(i).host, w.at(h).id);
    const Camera c = camera(w, h);
    const double distance = (c.R * bearing_of(w.view(w.track(i), h))).dot(points[static_cast<std::size_t>(i)] - c.c);
    EXPECT_NEAR(1 / factor.landmark(i).inverse_distance, distance, 1e-6);
  }
}

TEST(ReprojectionFactor, ALandmarkBehindItsHostBeginsAnewWithTheNewestView) {
  SyntheticWindow s = make_window({.frames = 8});
  Window& w = *s.window;
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  const int used = factor.unknowns();
  int i = 0;
  while (!w.seen(w.track(i), w.size() - 1)) ++i;
  factor.landmark(i).inverse_distance = -0.1;
  factor.collect(w, reprojection_settings());
  EXPECT_EQ(factor.unknowns(), used - 1);
  EXPECT_EQ(factor.landmark(i).host, 0u);
  const TrackRecord seen = w.track(i);
  const Slot last = w.newest();
  Slot& slot = w.append();  // once more the same image
  const std::uint64_t id = slot.id;
  slot = last;
  slot.id = id;
  static TrackedFrame frame;
  frame.features.clear();
  const Observation& o = w.view(seen, w.size() - 2);
  TrackedFeature f;
  f.id = seen.id;
  for (std::size_t q = 0; q < 3; ++q) f.bearing[q] = bearing_of(o)[static_cast<int>(q)];
  for (std::size_t q = 0; q < 6; ++q)
    f.pixel_jacobian[q] = chart_of(o)(static_cast<int>(q / 3), static_cast<int>(q % 3));
  frame.features.push_back(f);
  w.observe(frame);
  factor.collect(w, reprojection_settings());
  EXPECT_EQ(factor.unknowns(), used);
  EXPECT_EQ(factor.landmark(i).host, w.at(w.size() - 2).id);
}

/// VINS-Mono's rule: a host younger than the third newest of a full window says too little.
TEST(ReprojectionFactor, YoungHostsOfAFullWindowAreLeftOut) {
  SyntheticWindow s = make_window({.frames = kMaxFrames});
  Window& w = *s.window;
  for (int i = 0; i < w.track_count(); ++i) {
    TrackRecord& t = w.track(i);
    t.mask = w.bit(w.size() - 1) | w.bit(i % 2 ? w.size() - 3 : w.size() - 4);
  }
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  EXPECT_EQ(factor.unknowns(), (w.track_count() + 1) / 2);
}

// ---- marginalisation ----

/// All that the landmarks of frame 0 say, and the tracks stay for another time.
TEST(ReprojectionFactor, HandsOverEveryBearingOfTheLandmarksOfFrameZero) {
  SyntheticWindow s = make_window({.frames = 7, .tracks = 40, .pixel_noise = 1});
  Window& w = *s.window;
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, reprojection_settings());
  const Explicit reference(w, factor, w.size(), true);
  const auto system = std::make_unique<VisualSystem>();
  factor.marginalise_oldest(w, reprojection_settings(), *system);
  const MatrixXd H = dense(*system, w.size());
  EXPECT_NEAR(system->cost, reference.cost, 1e-10 * reference.cost);
  EXPECT_LT(scaled_difference(H, reference.reduced_H()), 1e-7);
  EXPECT_GE(least_eigenvalue(H), -1e-9 * H.norm());
}

/// Where the prior reaches the newest frame, a pose that is dropped later leaves it by marginalisation.
TEST(ReprojectionFactor, ForgetsAPoseAndKeepsWhatIsKnownOfTheOthers) {
  SyntheticWindow s = make_window({});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  VisualSettings settings = reprojection_settings();
  settings.gate = false;
  ReprojectionFactor factor(best_instruction_set());
  factor.collect(w, settings);
  Marginaliser marginaliser(best_instruction_set());
  marginaliser.marginalise_oldest(w, factor, settings);
  ASSERT_EQ(w.prior.frames, w.size());
  for (int k = 0; k < w.size(); ++k) w.at(k).x.p += Vec3(1e-3 * k, -2e-3, 5e-4);  // off the prior's centre
  auto solved = [&] { return solve_dense({dense_prior(w.prior), dense_prior_rhs(w.prior)}); };
  const DenseSolution before = solved();
  VectorXd displacement(w.prior.dim());
  prior_difference(w, displacement.data());
  const int k = w.size() - 2, n = w.prior.dim() - 6;
  marginaliser.forget_pose(w, k);
  ASSERT_EQ(w.prior.frames, w.size() - 1);
  const DenseSolution after = solved();
  auto old = [&](int i) { return i < 6 * k ? i : i + 6; };
  for (int i = 0; i < n; ++i) {
    const double unit = std::sqrt(before.covariance(old(i), old(i)));
    EXPECT_NEAR(after.step[i], before.step[old(i)] - displacement[old(i)], 1e-4 * unit) << i;
    for (int j = 0; j < n; ++j)
      EXPECT_NEAR(after.covariance(i, j), before.covariance(old(i), old(j)),
                  1e-5 * unit * std::sqrt(before.covariance(old(j), old(j))))
          << i << ", " << j;
  }
  marginaliser.forget_pose(w, w.size() - 1);  // not in there any more
  EXPECT_EQ(w.prior.frames, w.size() - 1);
}

/// Without any parallax the depth is held, and the rest stays finite and positive.
TEST(ReprojectionFactor, SurvivesZeroParallax) {
  for (const double lever : {0.0, 1.0}) {
    SyntheticWindow s = make_window({.motion = 0, .lever = lever, .state_error = 0});
    ReprojectionFactor factor(best_instruction_set());
    const auto system = std::make_unique<VisualSystem>();
    factor.collect(*s.window, reprojection_settings());
    factor.linearise(*s.window, *system);
    const MatrixXd H = dense(*system, s.window->size());
    ASSERT_TRUE(H.allFinite());
    EXPECT_GT(H.norm(), 1);
    EXPECT_GE(least_eigenvalue(H), -1e-9 * H.norm());
    factor.step(*s.window);
    factor.linearise(*s.window, *system);
    EXPECT_TRUE(std::isfinite(system->cost));
  }
}

}  // namespace
}  // namespace epiline::test
