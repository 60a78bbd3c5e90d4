// What the start must find, and what it must refuse: docs/derivations/initialisation.md.
#include "estimator/initialise/moving_start.h"

#include <gtest/gtest.h>

#include <string>

#include "estimator/initialise/gyroscope_bias.h"
#include "estimator/initialise/start_refinement.h"
#include "estimator/initialise/velocity_gravity.h"
#include "platform/memory/allocation_count.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/initialise/start_flight.h"
#include "tests/estimator/initialise/start_work.h"

namespace epiline::test {
namespace {

const Vec3 kEurocBias(-0.003, 0.021, 0.079);

std::optional<StartRefusal> solve(const StartProblem& problem, StartGuess& guess, const StartLimits& limits = {}) {
  StartMemory nothing;
  return solve_moving_start(problem, limits, work_space(), nothing, guess);
}

/// Least-squares size of the path found over the true one.
double scale(const StartFlight& f, const StartGuess& g) {
  double num = 0, den = 0;
  for (int k = 0; k < f.problem.frames; ++k) num += f.p[k].dot(g.p[k]), den += f.p[k].squaredNorm();
  return num / den;
}

TEST(GyroscopeBias, IsFoundFromRotationAlone) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.b_g = kEurocBias});
    Vec3 b_g = Vec3::Zero();
    ASSERT_TRUE(solve_gyroscope_bias(f.problem, work_space().kernels(), b_g));
    EXPECT_NEAR((b_g - kEurocBias).norm(), 0, 1e-3)
        << "seed " << seed;  // first order in the bias: 0.08 rad/s over 0.05 s
  }
}

TEST(GyroscopeBias, IsFoundWithoutTranslation) {
  StartMotion turn = wandering(5);
  turn.p = [](double) { return Vec3(0, 0, 0); };
  StartFlight f = fly(turn, {.b_g = kEurocBias});
  Vec3 b_g = Vec3::Zero();
  ASSERT_TRUE(solve_gyroscope_bias(f.problem, work_space().kernels(), b_g));
  EXPECT_NEAR((b_g - kEurocBias).norm(), 0, 2e-3);
}

TEST(GyroscopeBias, NeedsTracksInCommon) {
  StartFlight f = wander(1, {.points = 10});
  Vec3 b_g(1, 2, 3);
  EXPECT_FALSE(solve_gyroscope_bias(f.problem, work_space().kernels(), b_g));
  EXPECT_EQ(b_g, Vec3(1, 2, 3));
}

TEST(VelocityGravity, AreExactWithoutNoise) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.imu_per_interval = 200});
    StartPath path;
    chain(f.problem, Vec3::Zero(), Vec3::Zero(), path);
    StartState x;
    work_space().collect(f.problem);
    ASSERT_TRUE(solve_velocity_gravity(f.problem, work_space(), path, x)) << "seed " << seed;
    EXPECT_NEAR((x.v_0 - f.truth.v_0).norm(), 0, 1e-5) << "seed " << seed;
    EXPECT_NEAR((x.g_0 - f.truth.g_0).norm(), 0, 1e-5) << "seed " << seed;
    EXPECT_NEAR(x.g_0.norm(), kGravity, 1e-9);
  }
}

TEST(MovingStart, IsExactWithoutNoise) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.imu_per_interval = 200, .b_g = kEurocBias, .b_g_ref = kEurocBias});
    StartGuess g;
    ASSERT_EQ(solve(f.problem, g), std::nullopt) << "seed " << seed;
    EXPECT_NEAR((g.state.v_0 - f.truth.v_0).norm(), 0, 2e-6) << "seed " << seed;
    EXPECT_NEAR(angle(g.state.g_0, f.truth.g_0), 0, 2e-6) << "seed " << seed;
    EXPECT_NEAR((g.state.b_g - f.truth.b_g).norm(), 0, 2e-6) << "seed " << seed;
    for (int k = 0; k < f.problem.frames; ++k) {
      EXPECT_NEAR((g.p[k] - f.p[k]).norm(), 0, 1e-6) << "seed " << seed << " frame " << k;
      EXPECT_NEAR(so3_log(g.R[k].transpose() * f.R[k]).norm(), 0, 1e-6) << "seed " << seed << " frame " << k;
    }
  }
}

/// One pixel (of 458 to the radian) of noise, 2 % gross errors, both biases unknown: a guess is good or refused.
TEST(MovingStart, IsGoodOrRefusedUnderNoise) {
  int accepted = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> n(0, 0.05);
    StartFlight f = wander(seed, {.noise_rad = 1 / 458.0,
                                  .outliers = 0.02,
                                  .b_g = Vec3(n(random), n(random), n(random)),
                                  .b_a = Vec3(n(random), n(random), n(random))});
    StartGuess g;
    if (solve(f.problem, g)) continue;
    ++accepted;
    EXPECT_NEAR(scale(f, g), 1, 3.5 * g.sigma_scale) << "seed " << seed;
    EXPECT_LT((g.state.v_0 - f.truth.v_0).norm(), 3.5 * g.sigma_velocity) << "seed " << seed;
    EXPECT_LT(angle(g.state.g_0, f.truth.g_0), 3.5 * g.sigma_tilt) << "seed " << seed;
    EXPECT_LT((g.state.b_g - f.truth.b_g).norm(), 3.5 * g.sigma_b_g) << "seed " << seed;
    EXPECT_NEAR(g.residual, 1, 0.35) << "seed " << seed;
  }
  EXPECT_GE(accepted, 18);
}

/// The covariance is that of the errors: mean of e' C^-1 e over its 11 degrees of freedom, biases drawn from their
/// priors.
TEST(MovingStart, CovarianceIsHonest) {
  constexpr int kRuns = 60;
  double sum = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> n;
    StartFlight f = wander(seed, {.imu_per_interval = 20,
                                  .noise_rad = 0.5 / 458.0,
                                  .b_g = 0.02 * Vec3(n(random), n(random), n(random)),
                                  .b_a = 0.1 * Vec3(n(random), n(random), n(random))});
    f.problem.b_g_sigma = 0.02;
    StartState x = f.truth;
    StartPath path;
    RefinementFigures figures;
    work_space().collect(f.problem);
    ASSERT_TRUE(refine(f.problem, work_space(), x, path, figures));
    StartVector e;
    e << x.v_0 - f.truth.v_0, gravity_basis(x.g_0).transpose() * (x.g_0 - f.truth.g_0) / kGravity, x.b_g - f.truth.b_g,
        x.b_a - f.truth.b_a;
    sum += chi2(e, figures.covariance);
  }
  EXPECT_NEAR(sum / kRuns / kStartDof, 1, 0.25);  // Cauchy weights cost a little efficiency
}

TEST(MovingStart, RefusesConstantVelocity) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = fly(constant_velocity(Vec3(0.8, 0.5, 0.1)), {.noise_rad = 0.5 / 458.0, .seed = seed});
    StartGuess g;
    EXPECT_EQ(solve(f.problem, g), StartRefusal::kScaleUncertain)
        << "seed " << seed << " scale " << scale(f, g) << " +- " << g.sigma_scale;
    EXPECT_GT(g.sigma_scale, 1) << "seed " << seed;  // the damping of depths must not pass for knowledge
  }
}

TEST(MovingStart, RefusesHover) {
  StartFlight f = fly(constant_velocity(Vec3(0.001, 0, 0)), {.noise_rad = 0.5 / 458.0, .outliers = 0.01});
  StartGuess g;
  EXPECT_EQ(solve(f.problem, g), StartRefusal::kScaleUncertain);
}

TEST(MovingStart, RefusesTooLittleData) {
  StartFlight f = wander(1, {.frames = 3});
  StartGuess g;
  EXPECT_EQ(solve(f.problem, g), StartRefusal::kTooFewFrames);
  StartFlight few = wander(1, {.frames = 9, .points = 14});
  EXPECT_EQ(solve(few.problem, g), StartRefusal::kTooFewTracks);
}

TEST(MovingStart, RefusesTracksThatContradictTheImu) {
  StartFlight a = wander(1, {.noise_rad = 0.5 / 458}), b = wander(2, {.noise_rad = 0.5 / 458});
  a.problem.tracks = b.tracks;
  StartGuess g;
  EXPECT_EQ(solve(a.problem, g), StartRefusal::kResidualTooLarge);
}

/// Noise, and the least that is believed, px.
class Noise : public testing::TestWithParam<std::pair<double, double>> {};

/// White noise of up to 2 px where 0.5 px is expected: found, and all deviations with it. Less, where that is believed.
TEST_P(Noise, OfTheTracksIsFound) {
  const auto [noise_px, least_px] = GetParam();
  int accepted = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.frames = kStartFrames, .noise_rad = noise_px / 458});
    f.problem.sigma_rad = 0.5 / 458;
    StartGuess g;
    if (solve(f.problem, g, {.noise_least = least_px / 0.5})) continue;
    ++accepted;
    EXPECT_NEAR(458 * g.sigma_rad, std::max(least_px, noise_px), 0.1 + 0.1 * noise_px) << "seed " << seed;
    EXPECT_NEAR(scale(f, g), 1, 3.5 * g.sigma_scale) << noise_px << " px, seed " << seed;
    EXPECT_LT(angle(g.state.g_0, f.truth.g_0), 3.5 * g.sigma_tilt) << noise_px << " px, seed " << seed;
  }
  EXPECT_GE(accepted, noise_px < 2 ? 7 : 3) << noise_px << " px";
}
INSTANTIATE_TEST_SUITE_P(Px, Noise,
                         testing::Values(std::pair{0.3, 0.5}, std::pair{0.9, 0.5}, std::pair{1.3, 0.5},
                                         std::pair{2.0, 0.5}, std::pair{0.3, 0.3}, std::pair{0.1, 0.3},
                                         std::pair{0.9, 0.3}));

TEST(MovingStart, HoldsWithAQuarterOfAllBearingsWrong) {
  int accepted = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    StartFlight f = wander(seed, {.noise_rad = 0.5 / 458, .outliers = 0.25});
    StartGuess g;
    if (solve(f.problem, g)) continue;
    ++accepted;
    EXPECT_NEAR(scale(f, g), 1, 0.3) << "seed " << seed;
  }
  EXPECT_GE(accepted, 6);
}

/// Readings that have nothing to do with the images leave residuals that look like noise in their size, but have a
/// pattern: no noise may be assumed for them.
class Nonsense : public testing::TestWithParam<const char*> {};

TEST_P(Nonsense, IsNotTakenForNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    StartFlight f = wander(seed, {.noise_rad = 0.5 / 458});
    const std::string what = GetParam();
    if (what == "g" || what == "sign")
      for (Preintegration& p : f.interval) p.dp *= what == "g" ? 1 / 9.81 : -1, p.dv *= what == "g" ? 1 / 9.81 : -1;
    if (what == "turned") f.problem.R_BC = f.problem.R_BC * so3_exp(Vec3(0, 0, 0.35));
    if (what == "late") f.problem.interval = f.interval.data() + 2, f.problem.frames -= 2;
    for (StartTrack& t : f.tracks)
      while (t.count > 0 && t.frame[t.count - 1] >= f.problem.frames) --t.count;
    StartGuess g;
    const auto refusal = solve(f.problem, g);
    EXPECT_TRUE(refusal || g.sigma_rad < 0.501 / 458) << "seed " << seed << ", noise " << 458 * g.sigma_rad << " px";
  }
}
INSTANTIATE_TEST_SUITE_P(Readings, Nonsense, testing::Values("g", "sign", "turned", "late"),
                         [](const auto& test) { return test.param; });

TEST(MovingStart, TakesNoMoreIterationsThanAllowed) {
  StartFlight a = wander(1, {.noise_rad = 0.5 / 458}), b = wander(2, {.noise_rad = 0.5 / 458});
  a.problem.tracks = b.tracks;
  for (const int most : {1, 5, 12}) {
    StartState x;
    StartPath path;
    ApproachFigures figures;
    work_space().collect(a.problem);
    ASSERT_TRUE(approach(a.problem, work_space(), x, path, most, figures));
    EXPECT_GT(figures.iterations, 0);
    EXPECT_LE(figures.iterations, most);
  }
}

/// A hover leaves nothing to search for: no state is even tried.
TEST(MovingStart, TriesNothingWithoutParallax) {
  StartFlight f = fly(constant_velocity(Vec3::Zero()), {.noise_rad = 0.2 / 458.0});
  f.problem.sigma_rad = 0.5 / 458;
  StartGuess g;
  EXPECT_EQ(solve(f.problem, g), StartRefusal::kNoParallax);
  EXPECT_EQ(g.tracks, 0);
}

TEST(MovingStart, HoldsWithTheMostFramesAndTracks) {
  StartFlight f = fly(
      wandering(7), {.frames = kStartFrames, .points = kStartTracks + 50, .noise_rad = 0.5 / 458.0, .b_g = kEurocBias});
  StartGuess g;
  work_space();
  const HeapCallScope heap;
  const std::optional<StartRefusal> refusal = solve(f.problem, g);
  EXPECT_EQ(heap.calls(), 0u);
  ASSERT_EQ(refusal, std::nullopt);
  EXPECT_NEAR(scale(f, g), 1, 0.05);
  f.problem.frames = kStartFrames + 1;
  EXPECT_EQ(solve(f.problem, g), StartRefusal::kTooFewFrames);
}

}  // namespace
}  // namespace epiline::test
