// What the health says as the evidence changes.
#include "estimator/monitor/health.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

namespace epiline::test {
namespace {

constexpr double kFrame_s = 0.1;

FrameEvidence good() {
  FrameEvidence e;
  e.solved = true;
  e.tracks = 120;
  e.sigma_velocity = 0.02;
  e.sigma_tilt = 0.003;
  e.innovation = 1;
  e.parallax_px = 50;
  return e;
}

/// The same evidence for `seconds`; the health after the last frame.
Health show(HealthMonitor& m, const FrameEvidence& e, double seconds) {
  for (int i = 0; i < static_cast<int>(std::lround(seconds / kFrame_s)); ++i) m.update(e, kFrame_s);
  return m.health();
}

TEST(Health, GivenAWidePosteriorWhenItTightensThenTracking) {
  HealthMonitor m;
  FrameEvidence wide = good();
  wide.sigma_velocity = 0.2;
  Health h = show(m, wide, 5);
  EXPECT_EQ(h.state, HealthState::kInitialising);
  EXPECT_EQ(h.reasons, bit(HealthReason::kScaleUnknown));
  wide = good();
  wide.sigma_tilt = 0.03;
  h = show(m, wide, 1);
  EXPECT_EQ(h.state, HealthState::kInitialising);
  EXPECT_EQ(h.reasons, bit(HealthReason::kPosteriorWide));
  EXPECT_FALSE(m.reset_wanted());
  h = show(m, good(), kFrame_s);
  EXPECT_EQ(h.state, HealthState::kTracking);
  EXPECT_EQ(h.reasons, 0u);
  EXPECT_EQ(show(m, good(), 3).quality, 100);
}

TEST(Health, GivenAStartThatDoesNotSettleThenAResetAfterTenSeconds) {
  HealthMonitor m;
  FrameEvidence wide = good();
  wide.sigma_velocity = 1.2;
  wide.sigma_tilt = 0.03;
  show(m, wide, 9.9);
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(show(m, wide, 0.2).state, HealthState::kInitialising);
  EXPECT_TRUE(m.reset_wanted());
}

/// Nothing of a new start would know more.
TEST(Health, GivenAStartThatKnowsItsTiltWhenTheScaleStaysUnknownThenItSaysSoAndGoesOn) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.speed = 8;
  e.sigma_velocity = 2;
  const Health h = show(m, e, 60);
  EXPECT_EQ(h.state, HealthState::kInitialising) << "no position for a controller";
  EXPECT_EQ(h.reasons, bit(HealthReason::kScaleUnknown));
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(show(m, good(), kFrame_s).state, HealthState::kTracking);
}

TEST(Health, GivenAStartWhenItsVelocityIsUnknownThenAResetAfterTwoSeconds) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.sigma_velocity = 1.5;
  e.tracks = 5;
  const Health h = show(m, e, 1.9);
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(h.state, HealthState::kInitialising);
  show(m, e, 0.2);
  EXPECT_TRUE(m.reset_wanted());
}

/// There is nothing better to start from than a covariance that is wide but true.
TEST(Health, GivenTrackingWhenTheVelocityIsUnknownInFullViewThenLostWithoutAReset) {
  HealthMonitor m;
  show(m, good(), 2);
  FrameEvidence e = good();
  e.sigma_velocity = 1.5;
  EXPECT_EQ(show(m, e, 60).state, HealthState::kLost);
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(show(m, good(), 1).state, HealthState::kTracking);
}

TEST(Health, LimitsOfTheVelocityGrowWithTheSpeed) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.speed = 30;
  e.sigma_velocity = 1.6;
  EXPECT_EQ(show(m, e, 2).state, HealthState::kInitialising);
  e.sigma_velocity = 1.4;
  EXPECT_EQ(show(m, e, 2).state, HealthState::kTracking);
  e.sigma_velocity = 1.6;
  EXPECT_EQ(show(m, e, 2).state, HealthState::kDegraded);
  e.sigma_velocity = 6.1;
  EXPECT_EQ(show(m, e, 2).state, HealthState::kLost);
}

TEST(Health, GivenAStartWhenItIsFasterThanAnythingThatFliesSoThenAResetAtOnce) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.sigma_tilt = 0.03;
  e.speed = 59;
  show(m, e, 1);
  EXPECT_FALSE(m.reset_wanted());
  e.speed = 61;
  show(m, e, kFrame_s);
  EXPECT_TRUE(m.reset_wanted());
  HealthMonitor settled;  // a settled state may be as fast as it says
  show(settled, good(), 1);
  FrameEvidence fast = good();
  fast.speed = 61;
  show(settled, fast, 1);
  EXPECT_FALSE(settled.reset_wanted());
}

struct Trouble {
  const char* name;
  HealthReason reason;
  double seconds;  ///< until it is said
  void (*make)(FrameEvidence&);
};
class Degradation : public testing::TestWithParam<Trouble> {};

TEST_P(Degradation, GivenTrackingWhenTroubleComesAndGoesThenDegradedAndBack) {
  const Trouble& t = GetParam();
  HealthMonitor m;
  show(m, good(), 2);
  FrameEvidence e = good();
  t.make(e);
  if (t.seconds > kFrame_s) {
    EXPECT_EQ(show(m, e, t.seconds - kFrame_s).state, HealthState::kTracking);
  }
  const Health h = show(m, e, kFrame_s);
  EXPECT_EQ(h.state, HealthState::kDegraded);
  EXPECT_EQ(h.reasons, bit(t.reason));
  show(m, e, 10);
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(show(m, good(), kFrame_s).state, HealthState::kTracking);
}

INSTANTIATE_TEST_SUITE_P(
    Health, Degradation,
    testing::Values(
        Trouble{"few_tracks", HealthReason::kFewTracks, 0.1, [](FrameEvidence& e) { e.tracks = 19; }},
        Trouble{"many_gated", HealthReason::kManyGated, 1.1, [](FrameEvidence& e) { e.gated_share = 0.45; }},
        Trouble{"steps_rejected", HealthReason::kStepsRejected, 0.3, [](FrameEvidence& e) { e.steps_rejected = true; }},
        Trouble{"deadline", HealthReason::kDeadlineMissed, 0.1, [](FrameEvidence& e) { e.deadline_missed = true; }},
        Trouble{"imu_gap", HealthReason::kImuGap, 0.1, [](FrameEvidence& e) { e.imu_gap = true; }},
        Trouble{"number", HealthReason::kNumbersWrong, 0.1,
                [](FrameEvidence& e) { e.numbers_wrong = Severity::kSuspect; }},
        Trouble{"no_number_to_blame", HealthReason::kReadingsRefused, 0.1,
                [](FrameEvidence& e) { e.numbers_wrong = Severity::kSuspect, e.number_named = false; }},
        Trouble{"scale", HealthReason::kScaleUnknown, 0.1, [](FrameEvidence& e) { e.sigma_velocity = 0.5; }}),
    [](const auto& trouble) { return trouble.param.name; });

TEST(Health, GivenTrackingWhenTheVelocityIsUnknownThenLostAndAResetAfterTwoSeconds) {
  HealthMonitor m;
  show(m, good(), 2);
  FrameEvidence e = good();
  e.sigma_velocity = 1.5;
  e.tracks = 5;
  Health h = show(m, e, 1.9);
  EXPECT_EQ(h.state, HealthState::kLost);
  EXPECT_EQ(h.quality, -1);
  EXPECT_TRUE(h.reasons & bit(HealthReason::kScaleUnknown));
  EXPECT_FALSE(m.reset_wanted());
  show(m, good(), kFrame_s);  // one good frame and the clock starts anew
  show(m, e, 1.9);
  EXPECT_FALSE(m.reset_wanted());
  show(m, e, 0.3);
  EXPECT_TRUE(m.reset_wanted());
  m.restart();
  EXPECT_FALSE(m.reset_wanted());
  EXPECT_EQ(show(m, e, 1).state, HealthState::kInitialising);
}

TEST(Health, GivenAnyStateWhenTheEstimateIsNoNumberOrAbsurdThenAResetAtOnce) {
  for (const bool settled : {false, true})
    for (int what = 0; what < 3; ++what) {
      HealthMonitor m;
      if (settled) show(m, good(), 2);
      FrameEvidence e = good();
      if (what == 0) e.finite = false;
      if (what == 1) e.bias_accelerometer = 2;
      if (what == 2) e.bias_gyroscope = 0.6;
      m.update(e, kFrame_s);
      const Health h = m.health();
      EXPECT_TRUE(m.reset_wanted()) << what;
      EXPECT_TRUE(h.reasons & bit(what == 0 ? HealthReason::kNotFinite : HealthReason::kBiasImplausible));
      EXPECT_NE(h.state, HealthState::kTracking);
      EXPECT_EQ(h.quality, -1);
    }
}

/// Not-a-number compares false with everything: it must not pass for a small deviation, nor poison what comes after.
TEST(Health, GivenNotANumberInTheDeviationsThenNeverTracking) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.finite = false;
  e.sigma_velocity = e.sigma_tilt = std::nan("");
  EXPECT_NE(show(m, e, 1).state, HealthState::kTracking);
  m.restart();
  EXPECT_EQ(show(m, good(), 6).state, HealthState::kTracking);
}

TEST(Health, GivenAFlightThatFailedThenTheNextOneIsDoubtedForFiveSeconds) {
  HealthMonitor m;
  EXPECT_EQ(show(m, good(), 1).state, HealthState::kTracking) << "the first one is not";
  m.restart();
  EXPECT_EQ(show(m, good(), 1).state, HealthState::kTracking) << "nor one that no failure came before";
  FrameEvidence absurd = good();
  absurd.bias_accelerometer = 2;
  m.update(absurd, kFrame_s);
  ASSERT_TRUE(m.reset_wanted());
  m.restart();
  m.restart();  // as a reset and a start do
  const Health h = show(m, good(), 3);
  EXPECT_EQ(h.state, HealthState::kDegraded);
  EXPECT_EQ(h.reasons, bit(HealthReason::kPosteriorWide));
  m.restart();  // it goes on from what it knew
  EXPECT_EQ(show(m, good(), 1.9).state, HealthState::kDegraded);
  EXPECT_EQ(show(m, good(), 0.3).state, HealthState::kTracking);
  m.restart();
  EXPECT_EQ(show(m, good(), 1).state, HealthState::kTracking);
}

TEST(Health, QualityFallsWithoutParallaxUnlessNothingMoves) {
  HealthMonitor m;
  FrameEvidence e = good();
  e.parallax_px = 0;
  EXPECT_EQ(show(m, e, 5).quality, 50);
  e.at_rest = true;
  EXPECT_EQ(show(m, e, 5).quality, 100);
  e.at_rest = false;
  e.parallax_px = 4;
  EXPECT_EQ(show(m, e, 5).quality, 70);
}

TEST(Health, QualityFallsWhenImagesAndImuDisagree) {
  HealthMonitor m;
  FrameEvidence e = good();
  for (const auto& [innovation, quality] : {std::pair(2.0, 100), {3.0, 50}, {4.0, 0}, {1e9, 0}}) {
    e.innovation = innovation;
    EXPECT_EQ(show(m, e, 5).quality, quality) << innovation;
  }
}

TEST(Health, QualityFollowsTracksAndPosteriorSmoothly) {
  HealthMonitor m;
  int last = show(m, good(), 3).quality;
  EXPECT_EQ(last, 100);
  FrameEvidence few = good();
  few.tracks = 30;
  for (int i = 0; i < 30; ++i) {
    m.update(few, kFrame_s);
    const int now = m.health().quality;
    EXPECT_LE(now, last);
    EXPECT_GE(now, last - 15);
    last = now;
  }
  EXPECT_NEAR(last, 50, 1);
}

}  // namespace
}  // namespace epiline::test
