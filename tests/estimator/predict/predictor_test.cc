// docs/derivations/prediction.md
#include "estimator/predict/predictor.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "estimator/estimator.h"
#include "estimator/geometry/so3.h"
#include "platform/memory/allocation_count.h"
#include "tests/estimator/inertial/random_interval.h"

namespace epiline {
namespace {

using test::Random;
using test::Readings;
using Mat16 = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
using Vec16 = Eigen::Matrix<double, 16, 1>;

constexpr double kTimeOffset = 0.004;
constexpr HostStamp kStart{7'000'000'000};

HostStamp at(double seconds) { return kStart + Span::from_seconds(seconds); }

ImuSample sample(HostStamp t, const Vec3& w, const Vec3& a) {
  return {t, {w.x(), w.y(), w.z()}, {a.x(), a.y(), a.z()}};
}

/// What the estimator would publish for the state `x` at the IMU's time `t`: its pose moved back to the image's stamp.
Odometry solved(const NavState& x, HostStamp t, const Vec3& omega, const Mat16& P = Mat16::Identity(),
                double time_offset = kTimeOffset) {
  Odometry o;
  o.time_offset_s = time_offset;
  o.stamp = t - Span::from_seconds(time_offset);
  const double dt = (o.stamp - t).seconds();
  const Eigen::Quaterniond q(x.R * so3_exp(omega * dt));
  Eigen::Map<Vec3>(o.p_WB_m.data()) = x.p + x.v * dt;
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Vec3>(o.v_WB_m_s.data()) = x.v;
  Eigen::Map<Vec3>(o.omega_B_rad_s.data()) = omega;
  Eigen::Map<Vec3>(o.accelerometer_bias_m_s2.data()) = x.b_a;
  Eigen::Map<Vec3>(o.gyroscope_bias_rad_s.data()) = x.b_g;
  Eigen::Map<Mat16>(o.covariance.data()) = P;
  o.reset_counter = 3;
  o.health = {HealthState::kTracking, 0, 90};
  return o;
}

NavState state_of(const Odometry& o) {
  NavState x;
  x.p = Vec3(o.p_WB_m.data());
  x.v = Vec3(o.v_WB_m_s.data());
  x.R = Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]).toRotationMatrix();
  x.b_a = Vec3(o.accelerometer_bias_m_s2.data());
  x.b_g = Vec3(o.gyroscope_bias_rad_s.data());
  return x;
}

Mat16 covariance_of(const Odometry& o) { return Eigen::Map<const Mat16>(o.covariance.data()); }

NavState moved(NavState x, const Vec15& d) {
  retract_pose(x, d.head<6>());
  retract_velocity_biases(x, d.tail<9>());
  return x;
}

Vec15 difference(const NavState& from, const NavState& to) {
  Vec15 d;
  d << local_pose(from, to), local_velocity_biases(from, to);
  return d;
}

NavState some_state(Random& random) {
  NavState x;
  x.p = random.gaussian(3);
  x.v = random.gaussian(1);
  x.b_a = random.gaussian(0.1);
  x.b_g = random.gaussian(0.02);
  x.R = so3_exp(random.gaussian(1));
  return x;
}

/// A full covariance, nothing uncorrelated, with about these standard deviations.
Mat16 some_covariance(Random& random, double p, double theta, double v, double b_a, double b_g) {
  Mat16 A;
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) A(i, j) = (i == j) + 0.2 * random.gaussian(1).x();
  Vec16 s;
  s << Vec3::Constant(p), Vec3::Constant(theta), Vec3::Constant(v), Vec3::Constant(b_a), Vec3::Constant(b_g), 1e-3;
  return s.asDiagonal() * A * A.transpose() * s.asDiagonal();
}

PredictorConfig noisy() {
  PredictorConfig c;
  c.density.noise = {.gyroscope_density = 2e-3,
                     .gyroscope_random_walk = 2e-2,
                     .accelerometer_density = 2e-2,
                     .accelerometer_random_walk = 3e-1};
  return c;
}

PredictorConfig without_blending(PredictorConfig c) {
  c.blend_s = 0;
  return c;
}

void feed(Predictor& predictor, const Readings& s, int from, int to) {
  for (int k = from; k < to; ++k)
    ASSERT_EQ(predictor.add_imu(sample(at(k * s.dt), s.w[k], s.a[k])), ImuHistory::Push::kTaken);
}

// ---- the mean

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
    EXPECT_EQ(o.time_offset_s, kTimeOffset);
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
  const Readings s = test::agile_readings(50, 0.005, random);
  const NavState x0 = some_state(random);
  const double share = 0.4;
  Preintegration interval;
  interval.reset(x0.b_a, x0.b_g);
  const Vec3 w = s.w[10] + share * (s.w[11] - s.w[10]), a = s.a[10] + share * (s.a[11] - s.a[10]);
  interval.integrate(w, a, s.w[11], s.a[11], (1 - share) * s.dt, noisy().density.noise);
  test::integrate(s, 11, 49, noisy().density.noise, interval);
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
  const Readings s = test::agile_readings(40, 0.005, random);
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
    expected.p += 0.005 * expected.v;
    expected.R = expected.R * so3_exp(0.005 * Vec3(o.omega_B_rad_s.data()));
    const Odometry predicted = predictor.odometry();
    EXPECT_EQ(predicted.stamp, frame.stamp + Span::from_milliseconds(5));
    EXPECT_LT(difference(expected, state_of(predicted)).norm(), 1e-9);
    EXPECT_LT((Vec3(predicted.omega_B_rad_s.data()) - Vec3(o.omega_B_rad_s.data())).norm(), 1e-12);
  }
}

// ---- the covariance

TEST(PredictorCovariance, EqualsNumericalJacobiansAndPreintegratedNoise) {
  Random random(4);
  const Readings s = test::agile_readings(50, 0.005, random);
  const NavState x0 = some_state(random);
  const Mat16 P0 = some_covariance(random, 0.02, 0.01, 0.05, 0.05, 0.005);
  const auto end = [&](const NavState& from) {
    Predictor predictor(noisy());
    feed(predictor, s, 0, 50);
    predictor.correct(solved(from, at(0), s.w[0] - from.b_g, P0));
    return predictor.odometry();
  };
  const double h = 1e-5;
  Mat16 F = Mat16::Identity();
  for (int i = 0; i < 15; ++i) {
    const Vec15 d = h * Vec15::Unit(i);
    F.col(i).head<15>() = difference(state_of(end(moved(x0, -d))), state_of(end(moved(x0, d)))) / (2 * h);
  }
  const Preintegration interval = test::integrated(s, x0.b_a, x0.b_g, noisy().density.noise);
  Mat15 B = Mat15::Identity();
  B.block<3, 3>(0, 0) = B.block<3, 3>(6, 6) = x0.R;
  Mat16 expected = F * P0 * F.transpose();
  expected.topLeftCorner<15, 15>() += B * interval.C * B.transpose();
  const Mat16 P = covariance_of(end(x0));
  const Vec16 sigma = expected.diagonal().cwiseSqrt();
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      EXPECT_NEAR(P(i, j), expected(i, j), 1e-6 * sigma(i) * sigma(j)) << i << " " << j;
      EXPECT_EQ(P(i, j), P(j, i));
    }
}

/// A flight whose readings are noisy and whose biases walk, as the noise model says; truth by an integrator of its own.
struct NoisyFlight {
  NoisyFlight(const Readings& truth, const NavState& start, const ImuNoise& noise, Random& random) : measured(truth) {
    NavState x = start;
    for (int k = 0; k < truth.count; ++k) {
      if (k > 0) {
        const Vec3 w = 0.5 * (truth.w[k - 1] + truth.w[k]);
        const Mat3 R = x.R * Eigen::AngleAxisd(w.norm() * truth.dt, w.stableNormalized()).toRotationMatrix();
        const Vec3 a = 0.5 * (x.R * truth.a[k - 1] + R * truth.a[k]) + Vec3(0, 0, -9.81);
        x.p += x.v * truth.dt + 0.5 * a * truth.dt * truth.dt;
        x.v += a * truth.dt;
        x.R = R;
        x.b_a += random.gaussian(noise.accelerometer_random_walk * std::sqrt(truth.dt));
        x.b_g += random.gaussian(noise.gyroscope_random_walk * std::sqrt(truth.dt));
      }
      states.push_back(x);
      measured.w[k] += x.b_g + random.gaussian(noise.gyroscope_density / std::sqrt(truth.dt));
      measured.a[k] += x.b_a + random.gaussian(noise.accelerometer_density / std::sqrt(truth.dt));
    }
  }
  Readings measured;
  std::vector<NavState> states;
};

Vec16 drawn(const Mat16& P, Random& random) {
  Vec16 z;
  for (int i = 0; i < 16; ++i) z(i) = random.gaussian(1).x();
  return Eigen::LLT<Eigen::Matrix<double, 16, 16>>(P).matrixL() * z;
}

// Mean NEES over 16 dimensions: its standard deviation over 400 runs is 0.018.
TEST(PredictorCovariance, HoldsInMonteCarlo) {
  constexpr int kRuns = 400;
  Random random(5);
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Readings s = test::agile_readings(61, 0.005, random);
    const NavState x0 = some_state(random);
    const Mat16 P0 = some_covariance(random, 0.003, 0.002, 0.01, 0.05, 0.005);
    const Vec16 error = drawn(P0, random);
    const NoisyFlight flight(s, moved(x0, error.head<15>()), noisy().density.noise, random);
    Predictor predictor(noisy());
    feed(predictor, flight.measured, 0, 20);
    predictor.correct(solved(x0, at(0), flight.measured.w[0] - x0.b_g, P0));
    feed(predictor, flight.measured, 20, 61);
    const Odometry o = predictor.odometry();
    Vec16 off;
    off << difference(state_of(o), flight.states.back()), error(15);
    nees += off.dot(Eigen::LLT<Eigen::Matrix<double, 16, 16>>(covariance_of(o)).solve(off)) / 16 / kRuns;
  }
  RecordProperty("nees", std::to_string(nees));
  EXPECT_GT(nees, 0.92);
  EXPECT_LT(nees, 1.08);
}

// An estimator that measures position: its corrections are optimal, so the remaining offset is uncorrelated with the
// new error and the mean of P + e e^T must be the mean square error, right after a correction and while it fades.
TEST(PredictorCovariance, HoldsWhileACorrectionFades) {
  constexpr int kRuns = 1000, kImage = 20, kArrival = 30, kLater = 37;
  constexpr double kSigma = 0.002;
  Random random(6);
  for (const int end : {kArrival, kLater}) {
    Vec15 claimed = Vec15::Zero(), claimed_unblended = Vec15::Zero(), seen = Vec15::Zero();
    for (int run = 0; run < kRuns; ++run) {
      const Readings s = test::agile_readings(kLater + 1, 0.005, random);
      const NavState x0 = some_state(random);
      const Mat16 P0 = some_covariance(random, 0.02, 0.005, 0.03, 0.02, 0.002);
      const NoisyFlight flight(s, moved(x0, drawn(P0, random).head<15>()), noisy().density.noise, random);
      Predictor blended(noisy()), unblended(without_blending(noisy()));
      feed(blended, flight.measured, 0, kImage + 1);
      feed(unblended, flight.measured, 0, kImage + 1);
      blended.correct(solved(x0, at(0), flight.measured.w[0] - x0.b_g, P0));
      const Odometry prior = blended.odometry();
      feed(blended, flight.measured, kImage + 1, kArrival + 1);
      const Mat16 P = covariance_of(prior);
      const Vec3 innovation = flight.states[kImage].p + random.gaussian(kSigma) - state_of(prior).p;
      const Mat3 S = P.topLeftCorner<3, 3>() + kSigma * kSigma * Mat3::Identity();
      const Eigen::Matrix<double, 16, 3> K = P.leftCols<3>() * S.inverse();
      const NavState x = moved(state_of(prior), (K * innovation).head<15>());
      const Odometry posterior = solved(x, at(kImage * s.dt), Vec3(prior.omega_B_rad_s.data()), P - K * P.topRows<3>());
      ASSERT_EQ(blended.correct(posterior), Predictor::Correction::kBlended);
      unblended.correct(posterior);
      feed(blended, flight.measured, kArrival + 1, end + 1);
      feed(unblended, flight.measured, kImage + 1, end + 1);
      const Odometry o = blended.odometry();
      const Mat16 more = covariance_of(o) - covariance_of(unblended.odometry());
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Mat16>(more).eigenvalues()(0), -1e-12);
      seen += difference(state_of(o), flight.states[end]).cwiseAbs2() / kRuns;
      claimed += covariance_of(o).diagonal().head<15>() / kRuns;
      claimed_unblended += covariance_of(unblended.odometry()).diagonal().head<15>() / kRuns;
    }
    for (int i = 0; i < 15; ++i) {  // standard deviation 0.045
      EXPECT_GT(seen(i) / claimed(i), 0.8) << i;
      EXPECT_LT(seen(i) / claimed(i), 1.25) << i;
    }
    EXPECT_GT(claimed(0), 2 * claimed_unblended(0));  // or the offset would not be seen
  }
}

// ---- corrections

/// Flown for 0.3 s from x0 when a better state for the instant 0.2 s is about to come.
struct Corrected {
  explicit Corrected(const PredictorConfig& config, double size = 1) : predictor(config), unblended(config) {
    Random random(8);
    s = test::agile_readings(64, 0.005, random);
    const NavState x0 = some_state(random);
    Predictor first(without_blending(config));
    feed(first, s, 0, 41);
    first.correct(solved(x0, at(0), s.w[0] - x0.b_g, 1e-4 * Mat16::Identity()));
    Vec15 d = Vec15::Zero();
    d.head<9>() << 0.03, -0.05, 0.02, 0.01, -0.02, 0.04, 0.1, -0.1, 0.05;
    better = solved(moved(state_of(first.odometry()), size * d), at(0.2), s.w[40] - x0.b_g, 1e-5 * Mat16::Identity());
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

TEST(PredictorCorrection, WaitsForTheReadingsOfItsTime) {
  Random random(9);
  const Readings s = test::agile_readings(40, 0.005, random);
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
  bad.stamp = at(0) - Span::from_seconds(kTimeOffset);
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

// ---- readings, age, memory

TEST(Predictor, CountsAndLeavesOutBadReadings) {
  Random random(10);
  const Readings s = test::agile_readings(40, 0.005, random);
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
  const ImuNoise noise = predictor_config(estimator).density.noise;
  EXPECT_EQ(noise.gyroscope_density, 2e-3);
  EXPECT_EQ(noise.accelerometer_density, 4 * estimator.imu.accelerometer_density);
  EXPECT_EQ(noise.accelerometer_random_walk, estimator.imu.accelerometer_random_walk);
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
}  // namespace epiline
