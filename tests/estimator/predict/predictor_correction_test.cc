// What the predictor does with a newer solve. Derivation: docs/derivations/prediction.md
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/estimator/predict/predictor_fixture.h"

namespace epiline::test {
namespace {

/// Flown for 0.3 s from x0 when a better state for the instant 0.2 s is about to come.
struct Corrected {
  explicit Corrected(const PredictorConfig& config, double size = 1) : predictor(config), unblended(config) {
    Random random(8);
    s = agile_readings(64, 0.005, random);
    const NavState x0 = some_state(random);
    Predictor first(without_blending(config));
    feed(first, s, 0, 41);
    first.correct(solved(x0, at(0), s.w[0] - x0.b_g, 1e-4 * Mat16::Identity()));
    Vec15 d = Vec15::Zero();
    d.head<9>() << 0.03, -0.05, 0.02, 0.01, -0.02, 0.04, 0.1, -0.1, 0.05;
    better =
        solved(displaced(state_of(first.odometry()), size * d), at(0.2), s.w[40] - x0.b_g, 1e-5 * Mat16::Identity());
    feed(predictor, s, 0, 61);
    predictor.correct(solved(x0, at(0), s.w[0] - x0.b_g, 1e-4 * Mat16::Identity()));
    feed(unblended, s, 0, 61);
    unblended.correct(better);
  }
  Readings s;
  Odometry better;
  Predictor predictor, unblended;  // the latter has only the better state
};

TEST(PredictorCorrection, DoesNotJumpAndGetsThere) {
  // GIVEN a prediction 6 cm, 0.05 rad and 0.15 m/s off
  Corrected c(PredictorConfig{});
  const NavState before = state_of(c.predictor.odometry());
  // WHEN the correction comes
  ASSERT_EQ(c.predictor.correct(c.better), Predictor::Correction::kBlended);
  // THEN at that instant nothing moves
  NavState last = state_of(c.predictor.odometry());
  EXPECT_LT((last.p - before.p).norm(), 1e-12);
  EXPECT_LT((last.v - before.v).norm(), 1e-12);
  EXPECT_LT((last.R - before.R).norm(), 1e-12);
  // AND with every reading it moves as the corrected state does and by 1 - exp(-dt/0.1 s) of what is left
  NavState last_goal = state_of(c.unblended.odometry());
  const Vec3 p_off = before.p - last_goal.p, phi_off = so3_log(before.R * last_goal.R.transpose());
  for (int k = 1; k <= 200; ++k) {
    const ImuSample reading = sample(at((60 + k) * 0.005), c.s.w[k % 64], c.s.a[k % 64]);
    c.predictor.add_imu(reading);
    c.unblended.add_imu(reading);
    const NavState x = state_of(c.predictor.odometry()), goal = state_of(c.unblended.odometry());
    const double left = std::exp(-k * 0.005 / 0.1);
    EXPECT_LT((x.p - goal.p - left * p_off).norm(), 1e-9);
    EXPECT_LT((so3_log(x.R * goal.R.transpose()) - left * phi_off).norm(), 1e-9);
    const double step = 1 - std::exp(-0.005 / 0.1);
    EXPECT_LT((x.p - last.p - (goal.p - last_goal.p)).norm(), step * p_off.norm() + 1e-9);
    // the turn from sample to sample, as seen in the world
    const Mat3 turn = x.R * last.R.transpose(), goal_turn = goal.R * last_goal.R.transpose();
    EXPECT_LT(std::abs(so3_log(turn).norm() - so3_log(goal_turn).norm()), step * phi_off.norm() + 1e-9);
    // what is left is in the covariance, in the odometry's frames
    Vec9 e;
    e << difference(goal, x).head<9>();
    Mat16 more = covariance_of(c.predictor.odometry()) - covariance_of(c.unblended.odometry());
    more.topLeftCorner<9, 9>() -= e * e.transpose();
    EXPECT_LT(more.norm(), 1e-12);
    last = x;
    last_goal = goal;
  }
  EXPECT_LT((last.p - last_goal.p).norm(), 1e-4 * p_off.norm());
  EXPECT_LT((last.v - last_goal.v).norm(), 1e-4);
  EXPECT_LT((last.R - last_goal.R).norm(), 1e-4);
}

TEST(PredictorCorrection, BlendsAgainWhileStillBlending) {
  Corrected c(PredictorConfig{});
  c.predictor.correct(c.better);
  feed(c.predictor, c.s, 61, 63);
  const NavState before = state_of(c.predictor.odometry());
  Odometry next = c.better;
  next.stamp = next.stamp + Span::from_milliseconds(20);
  ASSERT_EQ(c.predictor.correct(next), Predictor::Correction::kBlended);
  EXPECT_LT(difference(before, state_of(c.predictor.odometry())).head<9>().norm(), 1e-12);
}

void expect_jump(Corrected& c) {
  ASSERT_EQ(c.predictor.correct(c.better), Predictor::Correction::kJumped);
  const Odometry o = c.predictor.odometry(), goal = c.unblended.odometry();
  EXPECT_LT(difference(state_of(goal), state_of(o)).norm(), 1e-12);
  EXPECT_LT((covariance_of(o) - covariance_of(goal)).norm(), 1e-12);
  EXPECT_EQ(c.predictor.stats().jumps, 2u);  // the first correction is one
}

TEST(PredictorCorrection, JumpsAtAResetIfTooLargeOrIfToldTo) {
  Corrected reset(PredictorConfig{});
  ++reset.better.reset_counter;
  expect_jump(reset);
  EXPECT_EQ(reset.predictor.odometry().reset_counter, 4u);

  Corrected far(PredictorConfig{}, 3);  // 0.14 rad
  expect_jump(far);

  Corrected hard(without_blending(PredictorConfig{}));
  expect_jump(hard);
}

// A receiver that fuses a large correction takes it for motion, unless the reset counter says otherwise.
TEST(PredictorCorrection, CountsWhatIsTooLargeToBeBlendedInAsAReset) {
  Corrected near(PredictorConfig{});
  near.predictor.correct(near.better);
  EXPECT_EQ(near.predictor.odometry().reset_counter, 3u);

  Corrected hard(without_blending(PredictorConfig{}));  // jumps by as little
  hard.predictor.correct(hard.better);
  EXPECT_EQ(hard.predictor.odometry().reset_counter, 3u);

  Corrected far(PredictorConfig{}, 3);
  far.predictor.correct(far.better);
  EXPECT_EQ(far.predictor.odometry().reset_counter, 4u);
  feed(far.predictor, far.s, 61, 63);
  EXPECT_EQ(far.predictor.odometry().reset_counter, 4u);
  Odometry next = far.better;
  next.stamp = next.stamp + Span::from_milliseconds(1);
  ++next.reset_counter;
  far.predictor.correct(next);
  EXPECT_EQ(far.predictor.odometry().reset_counter, 5u) << "a reset of the estimator's own";
}

TEST(PredictorCorrection, WaitsForTheReadingsOfItsTime) {
  Random random(9);
  const Readings s = agile_readings(40, 0.005, random);
  const NavState x0 = some_state(random);
  const Odometry o = solved(x0, at(0.1025), s.w[20] - x0.b_g);
  Predictor early{PredictorConfig{}}, late{PredictorConfig{}};
  feed(early, s, 0, 21);
  EXPECT_EQ(early.correct(o), Predictor::Correction::kDeferred);
  EXPECT_EQ(early.state(), Predictor::State::kWaiting);
  feed(early, s, 21, 40);
  feed(late, s, 0, 40);
  EXPECT_EQ(late.correct(o), Predictor::Correction::kJumped);
  EXPECT_EQ(early.state(), Predictor::State::kCurrent);
  EXPECT_LT(difference(state_of(late.odometry()), state_of(early.odometry())).norm(), 1e-12);
  EXPECT_EQ(early.stats().corrections, 1u);
}

TEST(PredictorCorrection, LeavesOutWhatItCannotUse) {
  Corrected c(PredictorConfig{});
  const Odometry before = c.predictor.odometry();
  Odometry bad = c.better;
  bad.v_WB_m_s[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(c.predictor.correct(bad), Predictor::Correction::kNotFinite);
  bad = c.better;
  bad.covariance[255] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(c.predictor.correct(bad), Predictor::Correction::kNotFinite);
  bad = c.better;
  bad.q_WB = {0, 0, 0, 0};
  EXPECT_EQ(c.predictor.correct(bad), Predictor::Correction::kNotFinite);
  bad = c.better;
  bad.stamp = at(0);
  EXPECT_EQ(c.predictor.correct(bad), Predictor::Correction::kOld);
  bad.stamp = at(-1);
  c.predictor.clear();
  EXPECT_EQ(c.predictor.correct(bad), Predictor::Correction::kNoReadings);
  EXPECT_EQ(c.predictor.state(), Predictor::State::kWaiting);
  EXPECT_EQ(c.predictor.stats().not_finite, 3u);
  EXPECT_EQ(c.predictor.stats().old, 1u);
  EXPECT_EQ(c.predictor.stats().no_readings, 1u);
  EXPECT_EQ(before.health.state, HealthState::kTracking);
}

}  // namespace
}  // namespace epiline::test
