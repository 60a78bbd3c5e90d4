// The predictor's mean, its readings and its age. Derivation: docs/derivations/prediction.md
#include "estimator/predict/predictor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "estimator/estimator.h"
#include "platform/memory/allocation_count.h"
#include "tests/estimator/predict/predictor_fixture.h"

namespace epiline::test {
namespace {

TEST(Predictor, IsExactForConstantRateAndConstantAcceleration) {
  Random random(1);
  const NavState x0 = some_state(random);
  const Vec3 w(0.4, -1.2, 0.7), a(1, -2, 0.5);
  Predictor predictor{PredictorConfig{}};
  const auto reading = [&](int k) {
    const Mat3 R = x0.R * so3_exp(w * (k * 0.005));
    return sample(at(k * 0.005), w + x0.b_g, R.transpose() * (a - kGravity_W) + x0.b_a);
  };
  for (int k = 0; k < 20; ++k) predictor.add_imu(reading(k));
  ASSERT_EQ(predictor.correct(solved(x0, at(0), w)), Predictor::Correction::kJumped);
  for (int k = 20; k <= 80; ++k) {
    predictor.add_imu(reading(k));
    const double t = k * 0.005;
    const Odometry o = predictor.odometry();
    const NavState x = state_of(o);
    EXPECT_EQ(o.stamp, at(t));
    EXPECT_LT((x.p - (x0.p + x0.v * t + 0.5 * a * t * t)).norm(), 1e-11);
    EXPECT_LT((x.v - (x0.v + a * t)).norm(), 1e-11);
    EXPECT_LT((x.R - x0.R * so3_exp(w * t)).norm(), 1e-11);
    EXPECT_LT((Vec3(o.omega_B_rad_s.data()) - w).norm(), 1e-12);
    EXPECT_EQ(x.b_a, x0.b_a);
    EXPECT_EQ(o.reset_counter, 3u);
    EXPECT_EQ(o.time_offset_s, 0);
  }
}

// A camera's clock that is off: pose and velocity come as those of the stamp, the base lies at the stamp plus the
// offset.
TEST(Predictor, TakesAStateBackToTheInstantOfTheFrame) {
  Random random(12);
  const Vec3 w(0.4, -1.2, 0.7), a(1, -2, 0.5);
  for (const double time_offset : {-0.008, -0.001, 0.001, 0.008}) {
    const NavState x0 = some_state(random);
    Predictor predictor{PredictorConfig{}};
    for (int k = 0; k <= 40; ++k) {
      const Mat3 R = x0.R * so3_exp(w * (k * 0.005 - 0.1));
      predictor.add_imu(sample(at(k * 0.005), w + x0.b_g, R.transpose() * (a - kGravity_W) + x0.b_a));
    }
    predictor.correct(solved(x0, at(0.1), w, Mat16::Identity(), time_offset, a));
    const Odometry o = predictor.odometry();
    const NavState x = state_of(o);
    EXPECT_EQ(o.time_offset_s, time_offset);
    EXPECT_NEAR(predictor.age_s(), 0.1, 1e-12);
    EXPECT_LT((x.v - (x0.v + a * 0.1)).norm(), 1e-5);  // a stamp's velocity taken for the frame's: 2 to 20 mm/s
    EXPECT_LT((x.p - (x0.p + x0.v * 0.1 + 0.5 * a * 0.01)).norm(), 1e-4);
    EXPECT_LT((x.R - x0.R * so3_exp(w * 0.1)).norm(), 1e-11);
  }
}

// Constant rate and force of the body: a helix. int_0^t Exp(w s) f ds = t J_r(-w t) f.
TEST(Predictor, FollowsConstantRateAndForce) {
  Random random(2);
  NavState x0 = some_state(random);
  const Vec3 w(0.4, -1.2, 0.7), f(3, -2, 9);
  Predictor predictor{PredictorConfig{}};
  for (int k = 0; k <= 500; ++k) {
    predictor.add_imu(sample(at(k * 1e-3), w + x0.b_g, f + x0.b_a));
    if (k == 0) predictor.correct(solved(x0, at(0), w));
  }
  const double t = 0.5;
  const NavState x = state_of(predictor.odometry());
  EXPECT_LT((x.v - (x0.v + kGravity_W * t + x0.R * (t * so3_right_jacobian(-w * t) * f))).norm(), 1e-6);
  EXPECT_LT((x.R - x0.R * so3_exp(w * t)).norm(), 1e-10);
}

// From between two readings, corrected late: as if integrated from there, both ends of the first piece interpolated.
TEST(Predictor, EqualsPreintegrationOverTheSameReadings) {
  Random random(3);
  const Readings s = agile_readings(50, 0.005, random);
  const NavState x0 = some_state(random);
  const double share = 0.4;
  Preintegration interval;
  interval.reset(x0.b_a, x0.b_g);
  const Vec3 w = s.w[10] + share * (s.w[11] - s.w[10]), a = s.a[10] + share * (s.a[11] - s.a[10]);
  interval.integrate(w, a, s.w[11], s.a[11], (1 - share) * s.dt, noisy().density.noise);
  integrate(s, 11, 49, noisy().density.noise, interval);
  for (const int corrected_at : {12, 30, 50}) {
    Predictor predictor(noisy());
    feed(predictor, s, 0, corrected_at);
    ASSERT_EQ(predictor.correct(solved(x0, at((10 + share) * s.dt), w - x0.b_g)), Predictor::Correction::kJumped);
    feed(predictor, s, corrected_at, 50);
    const NavState x = state_of(predictor.odometry());
    const double T = interval.T;
    EXPECT_LT((x.p - (x0.p + x0.v * T + 0.5 * kGravity_W * T * T + x0.R * interval.dp)).norm(), 1e-9);
    EXPECT_LT((x.v - (x0.v + kGravity_W * T + x0.R * interval.dv)).norm(), 1e-9);
    EXPECT_LT((x.R - x0.R * interval.dR).norm(), 1e-9);
    EXPECT_NEAR(predictor.age_s(), T, 1e-9);
  }
}

// Frames between two solves are predicted by the estimator itself: from a state published for one image, the predictor
// must be where the estimator is at the next one, once both poses belong to the same instant.
TEST(Predictor, AgreesWithTheEstimatorsOwnPrediction) {
  Random random(11);
  const Readings s = agile_readings(40, 0.005, random);
  EstimatorConfig config;
  config.extrinsics.time_offset_s = 0.005;
  const auto estimator = std::make_unique<Estimator>(config);
  Predictor predictor(predictor_config(config));
  Supervisor supervisor;
  TrackedFrame frame;
  int k = 0;
  const auto add_readings_until = [&](int end) {
    for (; k <= end; ++k) {
      const ImuSample reading = sample(at(k * s.dt), s.w[k], s.a[k]);
      ASSERT_TRUE(estimator->add_imu(reading));
      predictor.add_imu(reading);
    }
  };
  add_readings_until(20);
  const NavState x0 = some_state(random);
  InitialState start;
  start.p_WB = x0.p;
  start.v_WB = x0.v;
  start.R_WB = x0.R;
  start.b_a = x0.b_a;
  start.b_g = x0.b_g;
  frame.stamp = at(0.0925);  // on the IMU's clock halfway between two readings
  estimator->start(frame, start);
  ASSERT_EQ(predictor.correct(estimator->odometry()), Predictor::Correction::kJumped);
  for (const int end : {25, 32}) {
    add_readings_until(end);
    frame.stamp = at(end * s.dt - 0.005);
    const StepResult step = estimator->process(frame, supervisor);
    ASSERT_TRUE(step.has_pose && !step.solved);
    const Odometry o = estimator->odometry();
    NavState expected = state_of(o);
    const Mat3 R0 = expected.R;
    expected.R = R0 * so3_exp(s.dt * (0.5 * (s.w[end - 1] + s.w[end]) - x0.b_g));
    const Vec3 acceleration = 0.5 * (R0 * (s.a[end - 1] - x0.b_a) + expected.R * (s.a[end] - x0.b_a)) + kGravity_W;
    expected.p += s.dt * expected.v + 0.5 * s.dt * s.dt * acceleration;
    expected.v += s.dt * acceleration;
    const Odometry predicted = predictor.odometry();
    EXPECT_EQ(predicted.stamp, frame.stamp + Span::from_milliseconds(5));
    EXPECT_LT(difference(expected, state_of(predicted)).norm(), 1e-9);
    EXPECT_LT((Vec3(predicted.omega_B_rad_s.data()) - Vec3(o.omega_B_rad_s.data())).norm(), 1e-12);
  }
}

TEST(Predictor, CountsAndLeavesOutBadReadings) {
  Random random(10);
  const Readings s = agile_readings(40, 0.005, random);
  const NavState x0 = some_state(random);
  Predictor clean{PredictorConfig{}}, dirty{PredictorConfig{}};
  for (Predictor* p : {&clean, &dirty}) {
    feed(*p, s, 0, 10);
    p->correct(solved(x0, at(0), s.w[0] - x0.b_g));
  }
  const Vec3 nonsense(9, 9, 9), nan(0, std::numeric_limits<double>::quiet_NaN(), 0);
  for (int k = 10; k < 40; ++k) {
    feed(clean, s, k, k + 1);
    feed(dirty, s, k, k + 1);
    EXPECT_EQ(dirty.add_imu(sample(at(k * s.dt), nonsense, nonsense)), ImuHistory::Push::kDuplicate);
    EXPECT_EQ(dirty.add_imu(sample(at((k - 2) * s.dt), nonsense, nonsense)), ImuHistory::Push::kOutOfOrder);
    EXPECT_EQ(dirty.add_imu(sample(at((k + 0.5) * s.dt), nan, s.a[k])), ImuHistory::Push::kNotFinite);
  }
  EXPECT_EQ(difference(state_of(clean.odometry()), state_of(dirty.odometry())).norm(), 0);
  EXPECT_EQ(covariance_of(clean.odometry()), covariance_of(dirty.odometry()));
  EXPECT_EQ(dirty.stats().imu_duplicate, 30u);
  EXPECT_EQ(dirty.stats().imu_out_of_order, 30u);
  EXPECT_EQ(dirty.stats().imu_not_finite, 30u);
  EXPECT_EQ(dirty.stats().imu_samples, 130u);
}

/// A reading unlike those before it, corrupt or not, is doubted while it is the newest. With the next one the
/// prediction is that of a predictor that integrates all readings at once.
TEST(Predictor, RevisesWhatItDoubted) {
  const Vec3 up(0, 0, 9.81), turn(3, 0, 0);
  for (const bool is_real : {false, true}) {
    const auto reading = [&](int k) {
      const bool turned = k == 50 || (is_real && k > 50);
      return sample(at(0.005 * k), turned ? turn : Vec3(0.1, 0, 0), up);
    };
    Predictor early{PredictorConfig{}}, late{PredictorConfig{}};
    const Odometry base = solved(NavState{}, at(0), Vec3(0.1, 0, 0), 1e-4 * Mat16::Identity());
    for (int k = 0; k <= 60; ++k) {
      early.add_imu(reading(k));
      late.add_imu(reading(k));
      if (k == 0) early.correct(base);
      if (k == 50) {
        const Odometry doubted = early.odometry();
        EXPECT_NEAR(doubted.omega_B_rad_s[0], 0.1, 1e-9);
        EXPECT_LT(so3_log(state_of(doubted).R).norm(), 0.0251);
        EXPECT_GT(std::sqrt(covariance_of(doubted)(3, 3)), 0.01);
      }
    }
    late.correct(base);
    EXPECT_LT(difference(state_of(early.odometry()), state_of(late.odometry())).norm(), 1e-12);
    EXPECT_LT((covariance_of(early.odometry()) - covariance_of(late.odometry())).norm(), 1e-12);
    EXPECT_NEAR(so3_log(state_of(early.odometry()).R).norm(), is_real ? 0.025 + 1.45 * 0.005 + 0.15 : 0.03, 1e-3);
  }
}

TEST(Predictor, SaysWhenNoSolveCame) {
  Predictor predictor{PredictorConfig{}};
  EXPECT_EQ(predictor.state(), Predictor::State::kWaiting);
  EXPECT_EQ(predictor.odometry().health.state, HealthState::kInitialising);
  const Vec3 up(0, 0, 9.81);
  const auto sigma_p = [&] { return std::sqrt(covariance_of(predictor.odometry())(0, 0)); };
  double last_sigma = 0;
  for (int k = 0; k <= 12000; ++k) {  // more readings than are held
    predictor.add_imu(sample(at(k * 1e-3), Vec3::Zero(), up));
    if (k == 0) predictor.correct(solved(NavState{}, at(0), Vec3::Zero(), 1e-4 * Mat16::Identity()));
    if (k % 100 != 50) continue;
    const double age = k * 1e-3;
    const auto expected = age > 2     ? Predictor::State::kStale
                          : age > 0.5 ? Predictor::State::kCoasting
                                      : Predictor::State::kCurrent;
    const Health health = predictor.odometry().health;
    EXPECT_NEAR(predictor.age_s(), age, 1e-9);
    EXPECT_EQ(predictor.state(), expected);
    EXPECT_EQ(health.state, age > 2 ? HealthState::kLost : age > 0.5 ? HealthState::kDegraded : HealthState::kTracking);
    EXPECT_EQ(health.quality, age > 2 ? -1 : 90);
    EXPECT_EQ(health.reasons, age > 0.5 ? static_cast<std::uint32_t>(HealthReason::kDeadlineMissed) : 0u);
    EXPECT_GT(sigma_p(), last_sigma);
    last_sigma = sigma_p();
  }
  // A solve of now ends it.
  EXPECT_EQ(predictor.correct(solved(NavState{}, at(11.9), Vec3::Zero())), Predictor::Correction::kBlended);
  EXPECT_EQ(predictor.state(), Predictor::State::kCurrent);
  EXPECT_EQ(predictor.odometry().health.state, HealthState::kTracking);
}

TEST(Predictor, AssumesTheNoiseOfTheEstimator) {
  EstimatorConfig estimator;
  estimator.imu.gyroscope_density = 1e-3;
  estimator.gyroscope_density_factor = 2;
  estimator.accelerometer_density_factor = 4;
  estimator.accelerometer_walk_factor = 8;
  const ImuNoise noise = predictor_config(estimator).density.noise;
  EXPECT_EQ(noise.gyroscope_density, 2e-3);
  EXPECT_EQ(noise.accelerometer_density, 4 * estimator.imu.accelerometer_density);
  EXPECT_EQ(noise.accelerometer_random_walk, 8 * estimator.imu.accelerometer_random_walk);
}

TEST(PredictorMemory, NeverAsksForAny) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  const auto predictor = std::make_unique<Predictor>(PredictorConfig{});
  const HeapCallScope scope;
  for (int k = 0; k < 6000; ++k) {
    predictor->add_imu(sample(at(k * 1e-3), Vec3(0.1, 0, 0), Vec3(0, 0, 9.81)));
    if (k % 100 == 99)
      predictor->correct(solved(NavState{}, at(k * 1e-3 - (k % 300 == 299 ? -0.01 : 0.05)), Vec3::Zero()));
    predictor->odometry();
  }
  EXPECT_EQ(scope.calls(), 0u);
  EXPECT_EQ(predictor->stats().corrections, 59u);
}

}  // namespace
}  // namespace epiline::test
