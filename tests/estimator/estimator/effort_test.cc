// The estimator with little time: deadlines, less effort, none at all.
#include <gtest/gtest.h>

#include <string>

#include "tests/estimator/any_factor.h"
#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

class Late final : public Supervisor {
 public:
  bool time_is_up() noexcept override { return true; }
  void phase(Phase p) noexcept override { ++seen[static_cast<int>(p)]; }
  int seen[3] = {};
};

TEST(EstimatorDeadline, IsCountedSaidAndSurvived) {
  // GIVEN an estimator that wants two steps a frame and is always late, so that it takes one
  Late late;
  EstimatorConfig config;
  config.steps = 2;
  Rig rig({.moving_from = 2}, config);
  rig.supervisor = &late;
  // WHEN it flies
  int said = 0;
  rig.run_to(6, [&] {
    if (!rig.has(HealthReason::kDeadlineMissed)) return;
    ++said;
    EXPECT_NE(rig.odometry().health.state, HealthState::kTracking);
  });
  // THEN the misses are counted and said (of most frames the first step is so small that none is missed), and one step
  // a frame is enough to fly on
  EXPECT_GT(rig.stats().deadline_hits, 0u);
  EXPECT_GE(said, static_cast<int>(rig.stats().deadline_hits));
  EXPECT_LE(rig.stats().deadline_hits, rig.stats().frames_solved);
  EXPECT_LT(rig.velocity_error(), 0.1);
  EXPECT_GT(late.seen[static_cast<int>(Supervisor::Phase::kSolve)], 20);
  EXPECT_GT(late.seen[static_cast<int>(Supervisor::Phase::kMarginalise)], 5);
}

struct Frugality {
  const char* name;
  Supervisor::Effort effort;
};
void PrintTo(const Frugality& f, std::ostream* out) { *out << f.name; }

class EstimatorEffort : public testing::TestWithParam<Frugality> {};

TEST_P(EstimatorEffort, LittleOfItIsSaidAndSufficesAndIsTakenBack) {
  expect_little_effort_suffices({}, GetParam().effort);
}

INSTANTIATE_TEST_SUITE_P(All, EstimatorEffort,
                         testing::Values(Frugality{"tracks", {true, 60, 0}}, Frugality{"one_step", {true, 0, 1}},
                                         Frugality{"both", {true, 60, 1}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(EstimatorWithoutTime, PredictionAloneGrowsItsCovarianceAndSaysSo) {
  // GIVEN an estimator that may not solve for a second
  Frugal frugal;
  Rig rig({.moving_from = 2}, EstimatorConfig{});
  rig.supervisor = &frugal;
  rig.run_to(5);
  const std::uint64_t solved = rig.stats().frames_solved;
  frugal.given.solve = false;
  double sigma = rig.sigma_position();
  // THEN every frame has a pose whose uncertainty is larger than that of the one before, and it lies within it
  rig.run_to(6, [&] {
    EXPECT_TRUE(rig.last().has_pose);
    EXPECT_FALSE(rig.last().solved);
    EXPECT_GT(rig.sigma_position(), sigma);
    sigma = rig.sigma_position();
  });
  EXPECT_EQ(rig.stats().frames_solved, solved);
  EXPECT_GE(rig.stats().frames_predicted_for_time, 19u);
  EXPECT_TRUE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_LT(rig.velocity_error(), 4 * rig.sigma_velocity());
  // AND flies on when it may solve again
  frugal.given = {};
  rig.run_to(7);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_EQ(rig.stats().resets, 0u);
  const EstimatorStats& s = rig.stats();
  EXPECT_EQ(s.frames, s.frames_solved + s.frames_predicted + s.frames_without_pose + s.frames_refused);
}

}  // namespace
}  // namespace epiline::test
