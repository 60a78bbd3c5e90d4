// Noisy and wrong tracks through the whole estimator: it starts within seconds and flies as well as it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

struct Tracks {
  const char* name;
  double noise_px, wandering;
};
void PrintTo(const Tracks& t, std::ostream* out) { *out << t.name; }

/// The rig's tracks have it so.
EstimatorConfig white() {
  EstimatorConfig config;
  config.track_noise = TrackNoiseModel::kWhite;
  return config;
}

class EstimatorNoise : public testing::TestWithParam<Tracks> {
 protected:
  /// Starts in motion and flies for eight seconds.
  void fly() {
    rig.pixel_noise = GetParam().noise_px;
    rig.wandering_share = GetParam().wandering;
    rig.most_features = 150;
    rig.run_to(8, [&] {
      if (!rig.last().has_pose) return;
      if (first_pose < 0) first_pose = rig.now();
      if (rig.now() < first_pose + 2) return;
      ++frames;
      tracking += rig.odometry().health.state == HealthState::kTracking;
      worst_velocity = std::max(worst_velocity, rig.velocity_error());
      worst_sigmas = std::max(worst_sigmas, rig.velocity_error() / rig.sigma_velocity());
    });
  }
  Rig rig{Flight{.moving_from = -2}, white()};
  double first_pose = -1, worst_velocity = 0, worst_sigmas = 0;
  int frames = 0, tracking = 0;
};

TEST_P(EstimatorNoise, StartsInMotionAndFliesAsWellAsItSays) {
  fly();
  ASSERT_GT(first_pose, 0);
  EXPECT_EQ(rig.stats().start_kind, StartKind::kMoving);
  EXPECT_LT(first_pose, 1.5);
  EXPECT_LT(worst_velocity, 0.02 + 0.04 * GetParam().noise_px);
  EXPECT_LT(worst_sigmas, 3);
  for (const Suspicion& s : rig.stats().suspicions)
    EXPECT_EQ(s.severity, Severity::kNone) << &s - rig.stats().suspicions.data() << ": " << s.figure;
  EXPECT_GT(tracking, 0.9 * frames);
  EXPECT_EQ(rig.stats().resets, 0u);
  if (GetParam().wandering == 0) {
    EXPECT_NEAR(rig.stats().pixel_sigma / GetParam().noise_px, 1, 0.25);  // it has ten seconds' memory
  }
}

INSTANTIATE_TEST_SUITE_P(Tracks, EstimatorNoise,
                         testing::Values(Tracks{"as_assumed", 0.5, 0}, Tracks{"0_7_px", 0.7, 0},
                                         Tracks{"0_8_px", 0.8, 0}, Tracks{"0_9_px", 0.9, 0}, Tracks{"1_2_px", 1.2, 0},
                                         Tracks{"2_px", 2, 0}, Tracks{"a_quarter_wrong", 0.3, 0.25},
                                         Tracks{"a_quarter_wrong_and_0_9_px", 0.9, 0.25}),
                         [](const auto& test) { return std::string(test.param.name); });

/// What moves by itself, or slides along an edge, contradicts the other tracks as well as the numbers.
TEST(EstimatorNoise, MostTracksWrongAreNoWrongNumber) {
  Rig rig({.moving_from = -2}, {});
  rig.most_features = 150;
  rig.wandering_share = 0.6;
  rig.wandering_from = 4;
  double worst_sigmas = 0;
  rig.run_to(12, [&] {
    if (rig.now() > 3) worst_sigmas = std::max(worst_sigmas, rig.velocity_error() / rig.sigma_velocity());
  });
  EXPECT_LT(worst_sigmas, 3);
  EXPECT_EQ(rig.stats().resets, 0u);
  EXPECT_FALSE(rig.has(HealthReason::kNumbersWrong));
  EXPECT_GT(rig.stats().gated + rig.stats().gate_suspended, 50u);
  for (const Suspicion& s : rig.stats().suspicions)
    EXPECT_EQ(s.severity, Severity::kNone) << &s - rig.stats().suspicions.data() << ": " << s.figure;
}

/// Three pixels are no property of tracks but a fault: it says why it does not start, and hands out nothing.
TEST(EstimatorNoiseLimit, BeyondItNothingStartsAndTheReasonIsCounted) {
  Rig rig({.moving_from = -2}, {});
  rig.pixel_noise = 3;
  rig.most_features = 150;
  rig.run_to(4, [&] { EXPECT_FALSE(rig.last().has_pose) << rig.now(); });
  EXPECT_GT(rig.stats().start_refused[static_cast<int>(StartRefusal::kResidualTooLarge)], 30u);
  EXPECT_TRUE(rig.has(HealthReason::kNoInitialState));
}

}  // namespace
}  // namespace epiline::test
