// docs/derivations/imu.md
#include "estimator/inertial/preintegration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "estimator/geometry/so3.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/inertial/random_interval.h"

namespace epiline::test {
namespace {

const ImuNoise kDefaultNoise{};

double difference_in_sigmas(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
  return in_units(A - B, B.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
}

// Rotation at constant rate, constant acceleration of the origin: the midpoint rule is exact for it.
TEST(Preintegration, IsExactForConstantRateAndConstantAcceleration) {
  const Vec3 w(0.4, -1.2, 0.7), a(3, -2, 9), b_a(0.1, -0.2, 0.05), b_g(0.01, 0.08, -0.03);
  const double dt = 0.005;
  Preintegration interval;
  interval.reset(b_a, b_g);
  const auto specific_force = [&](int k) -> Vec3 { return so3_exp(w * (k * dt)).transpose() * a + b_a; };
  for (int k = 0; k < 200; ++k)
    interval.integrate(w + b_g, specific_force(k), w + b_g, specific_force(k + 1), dt, kDefaultNoise);
  EXPECT_NEAR(interval.T, 1, 1e-12);
  EXPECT_LT((interval.dp - 0.5 * a).norm(), 1e-12);
  EXPECT_LT((interval.dv - a).norm(), 1e-12);
  EXPECT_LT((interval.dR - Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix()).norm(), 1e-12);
}

// Constant rate and constant specific force in the body: the closed form is an integral of Exp, the rule is of second
// order.
TEST(Preintegration, ConvergesWithTheSquareOfTheStep) {
  const Vec3 w(0.4, -1.2, 0.7), a(3, -2, 9);
  const Vec3 dv = so3_right_jacobian(-w) * a;  // int_0^1 Exp(w t) dt a
  double error[2];
  for (int n = 0; n < 2; ++n) {
    const int steps = n == 0 ? 50 : 100;
    Preintegration interval;
    interval.reset(Vec3::Zero(), Vec3::Zero());
    for (int k = 0; k < steps; ++k) interval.integrate(w, a, w, a, 1.0 / steps, kDefaultNoise);
    error[n] = (interval.dv - dv).norm();
  }
  EXPECT_LT(error[0], 1e-3);
  EXPECT_NEAR(error[0] / error[1], 4, 0.02);
}

RC_GTEST_PROP(PreintegrationProperty, MeanEqualsAnIndependentIntegrator, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(2 + *rc::gen::inRange(0, 60), random.uniform(0.001, 0.01), random);
  const Vec3 b_a = random.gaussian(0.3), b_g = random.gaussian(0.1);
  const double by_a = random.uniform(0.9, 1.1), by_g = random.uniform(0.9, 1.1);
  const Preintegration interval = integrated(s, b_a, b_g, kDefaultNoise, {by_a - 1, by_g - 1});
  Motion m;
  for (int k = 0; k + 1 < s.count; ++k)
    step(m, by_g * (s.w[k] - b_g), by_a * (s.a[k] - b_a), by_g * (s.w[k + 1] - b_g), by_a * (s.a[k + 1] - b_a), s.dt);
  RC_ASSERT((interval.dp - m.p).norm() < 1e-12);
  RC_ASSERT((interval.dv - m.v).norm() < 1e-12);
  RC_ASSERT((interval.dR - m.q.toRotationMatrix()).norm() < 1e-12);
}

// F is accurate to second order in the step, hence so is J: blocks that vanish with the interval are compared on the
// scale they have after the whole interval.
RC_GTEST_PROP(PreintegrationProperty, JacobianPredictsReintegrationWithOtherBiases, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(21, 0.005, random);
  const Preintegration at = integrated(s, Vec3::Zero(), Vec3::Zero(), kDefaultNoise);
  const double h = 1e-5;
  for (int bias = 0; bias < 2; ++bias) {
    Eigen::Matrix<double, 9, 3> numeric;
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 d = h * Vec3::Unit(axis), zero = Vec3::Zero();
      const Preintegration plus = integrated(s, bias == 0 ? d : zero, bias == 1 ? d : zero, kDefaultNoise);
      const Preintegration minus = integrated(s, bias == 0 ? -d : zero, bias == 1 ? -d : zero, kDefaultNoise);
      numeric.col(axis) << plus.dp - minus.dp,
          so3_log(at.dR.transpose() * plus.dR) - so3_log(at.dR.transpose() * minus.dR), plus.dv - minus.dv;
    }
    numeric /= 2 * h;
    for (int row = 0; row < 9; row += 3) {
      const Mat3 analytic = at.J.block<3, 3>(row, 9 + 3 * bias), expected = numeric.block<3, 3>(row, 0);
      RC_ASSERT((analytic - expected).norm() < 1e-6 * expected.norm() + 1e-9);
    }
  }
}

// Five-point differences of re-integration at other scales, for an interval as it is integrated and as it is joined.
RC_GTEST_PROP(PreintegrationProperty, ScaleColumnsPredictReintegrationAtOtherScales, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(41, 0.005, random);
  const Vec3 b_a = random.gaussian(0.1), b_g = random.gaussian(0.05);
  const ImuScale scale{random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05)};
  const Preintegration at = integrated(s, b_a, b_g, kDefaultNoise, scale);
  const double h = 1e-3;
  ScaleColumns numeric;
  for (int column = 0; column < 2; ++column) {
    const auto moved = [&](double x) -> Vec9 {
      const ImuScale there{scale.accelerometer + (column == 0 ? x : 0), scale.gyroscope + (column == 1 ? x : 0)};
      const Preintegration z = integrated(s, b_a, b_g, kDefaultNoise, there);
      return (Vec9() << z.dp, so3_log(at.dR.transpose() * z.dR), z.dv).finished();
    };
    numeric.col(column) = (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h);
  }
  RC_ASSERT((at.by_scale() - numeric).norm() < 1e-7 * numeric.norm());

  Preintegration joined, second;
  joined.reset(b_a, b_g, scale);
  integrate(s, 0, 17, kDefaultNoise, joined);
  second.reset(b_a, b_g, scale);
  integrate(s, 17, s.count - 1, kDefaultNoise, second);
  joined.join(second);
  RC_ASSERT((joined.by_scale() - numeric).norm() < 1e-7 * numeric.norm());
}

// The second interval was integrated at other scales: exact to first order.
RC_GTEST_PROP(PreintegrationProperty, JoinMovesTheSecondIntervalToTheScalesOfTheFirst, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(41, 0.005, random);
  const Vec3 b_a = random.gaussian(0.1), b_g = random.gaussian(0.05);
  const ImuScale scale{0.03, -0.02}, other{0.032, -0.018};
  Preintegration joined, second;
  joined.reset(b_a, b_g, scale);
  integrate(s, 0, 20, kDefaultNoise, joined);
  second.reset(b_a, b_g, other);
  integrate(s, 20, 40, kDefaultNoise, second);
  joined.join(second);
  const Preintegration direct = integrated(s, b_a, b_g, kDefaultNoise, scale);
  RC_ASSERT((joined.dp - direct.dp).norm() < 2e-6);  // the shift itself is 2e-4 and more
  RC_ASSERT((joined.dv - direct.dv).norm() < 2e-5);
  RC_ASSERT((joined.dR - direct.dR).norm() < 2e-6);
}

RC_GTEST_PROP(PreintegrationProperty, CorrectedEqualsReintegrationToSecondOrder, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(21, 0.005, random);
  const Preintegration at = integrated(s, Vec3::Zero(), Vec3::Zero(), kDefaultNoise);
  const Vec3 b_a = random.gaussian(0.05), b_g = random.gaussian(0.005);
  const Preintegration moved = integrated(s, b_a, b_g, kDefaultNoise);
  Vec3 p, v;
  Mat3 R;
  at.corrected(b_a, b_g, {}, p, v, R);
  const double p_shift = (moved.dp - at.dp).norm(), v_shift = (moved.dv - at.dv).norm();
  RC_ASSERT((p - moved.dp).norm() < 0.01 * p_shift);
  RC_ASSERT((v - moved.dv).norm() < 0.01 * v_shift);
  RC_ASSERT((R - moved.dR).norm() < 0.01 * (moved.dR - at.dR).norm());
}

// Noise that is constant during a step is what Q assumes. Whitened with the predicted covariance, the sample covariance
// of N runs is the identity with standard deviation sqrt(2/N) on and sqrt(1/N) off the diagonal; 5 of those, and 0.02
// for the terms of second order in the step that Q leaves out.
// Three steps see what a single one adds; forty see how it propagates.
class PreintegrationCovariance : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Steps, PreintegrationCovariance, testing::Values(3, 40));

TEST_P(PreintegrationCovariance, EqualsMonteCarlo) {
  constexpr int kRuns = 10000;
  // Walks of the biases large enough to matter within the interval.
  const ImuNoise noise{.gyroscope_density = 2e-3,
                       .gyroscope_random_walk = 2e-2,
                       .accelerometer_density = 2e-2,
                       .accelerometer_random_walk = 3e-1};
  Random random(7);
  const Readings s = agile_readings(GetParam() + 1, 0.005, random);
  const Preintegration predicted = integrated(s, Vec3::Zero(), Vec3::Zero(), noise);
  Motion truth;
  for (int k = 0; k + 1 < s.count; ++k) step(truth, s.w[k], s.a[k], s.w[k + 1], s.a[k + 1], s.dt);

  const Eigen::MatrixXd whitening = inverse(lower_factor(predicted.C));
  ASSERT_TRUE(whitening.allFinite());
  Mat15 sample = Mat15::Zero();
  const double root_dt = std::sqrt(s.dt);
  for (int run = 0; run < kRuns; ++run) {
    Motion m;
    Vec3 b_a = Vec3::Zero(), b_g = Vec3::Zero();
    for (int k = 0; k + 1 < s.count; ++k) {
      const Vec3 a = b_a + random.gaussian(noise.accelerometer_density / root_dt);
      const Vec3 w = b_g + random.gaussian(noise.gyroscope_density / root_dt);
      step(m, s.w[k] + w, s.a[k] + a, s.w[k + 1] + w, s.a[k + 1] + a, s.dt);
      b_a += random.gaussian(noise.accelerometer_random_walk * root_dt);
      b_g += random.gaussian(noise.gyroscope_random_walk * root_dt);
    }
    Vec15 error;  // what the true state is off the predicted one
    error << truth.p - m.p, so3_log((m.q.conjugate() * truth.q).toRotationMatrix()), truth.v - m.v, b_a, b_g;
    const Eigen::VectorXd white = product(whitening, error);
    for (int i = 0; i < 15; ++i)
      for (int j = 0; j <= i; ++j) sample(i, j) += white[i] * white[j] / kRuns;
  }
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j <= i; ++j)
      EXPECT_NEAR(sample(i, j), i == j, 5 * std::sqrt((i == j ? 2.0 : 1.0) / kRuns) + 0.02) << i << " " << j;
}

// Readings with that acceleration show where it leads.
TEST(Preintegration, DoubtedForcesClaimWhatAConstantAccelerationWouldMove) {
  const ImuNoise noise{};
  Random random(3);
  const Readings s = agile_readings(21, 0.005, random);
  Readings pushed = s;
  const Vec3 extra(0, 0, 3);
  Mat3 R = Mat3::Identity();
  for (int k = 0; k < s.count; ++k) {  // constant in the axes of the beginning
    pushed.a[k] += R.transpose() * extra;
    if (k + 1 < s.count) R = R * so3_exp(0.5 * (s.w[k] + s.w[k + 1]) * s.dt);
  }
  Preintegration doubted = integrated(s, Vec3::Zero(), Vec3::Zero(), noise);
  const Preintegration there = integrated(pushed, Vec3::Zero(), Vec3::Zero(), noise);
  const Mat15 before = doubted.C;
  doubted.doubt_forces(3);
  const Mat15 added = doubted.C - before;
  Vec15 moved = Vec15::Zero();
  moved.segment<3>(0) = there.dp - doubted.dp;
  moved.segment<3>(6) = there.dv - doubted.dv;
  for (const int i : {2, 8})
    for (const int j : {2, 8}) EXPECT_NEAR(added(i, j), moved(i) * moved(j), 0.02 * std::abs(moved(i) * moved(j)));
  EXPECT_GT(added(11, 11), 0) << "the bias may have stepped";
  EXPECT_NEAR(added.diagonal().sum(), 3 * (added(2, 2) + added(8, 8) + added(11, 11)), 1e-12);
  const Mat15 C = doubted.C;
  doubted.doubt_forces(0);
  EXPECT_EQ(doubted.C, C);
}

// Readings with another bias, from the beginning or from the end on, show where it leads.
TEST(Preintegration, DoubtedRatesClaimWhatAStepOfTheBiasWouldMove) {
  const ImuNoise noise{};
  Random random(4);
  const Readings s = agile_readings(21, 0.005, random);
  const Vec3 step(0, 1e-4, 0);
  Preintegration doubted = integrated(s, Vec3::Zero(), Vec3::Zero(), noise);
  const Preintegration there = integrated(s, Vec3::Zero(), step, noise);
  const Mat15 before = doubted.C;
  doubted.doubt_rates(step.norm());
  const Mat15 added = doubted.C - before;
  Vec15 moved = Vec15::Zero();
  moved.segment<3>(0) = there.dp - doubted.dp;
  moved.segment<3>(3) = so3_log(doubted.dR.transpose() * there.dR);
  moved.segment<3>(6) = there.dv - doubted.dv;
  EXPECT_NEAR(added(13, 13), step.squaredNorm(), 1e-3 * step.squaredNorm());
  for (int i = 0; i < 9; ++i)
    EXPECT_NEAR(added(i, 13), 0.5 * step.norm() * moved(i), 0.01 * step.norm() * moved.norm()) << i;
}

// Each step alone leaves the axes of the beginning and comes back to them.
RC_GTEST_PROP(PreintegrationProperty, StepsTogetherEqualStepsAlone, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(41, 0.005, random);
  const ImuScale scale{random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05)};
  const Preintegration alone = integrated(s, Vec3::Zero(), Vec3::Zero(), kDefaultNoise, scale);
  Preintegration together;
  together.reset(Vec3::Zero(), Vec3::Zero(), scale);
  {
    Integration integration(together);
    for (int k = 0; k + 1 < s.count; ++k) integration.step(s.w[k], s.a[k], s.w[k + 1], s.a[k + 1], s.dt, kDefaultNoise);
  }
  RC_ASSERT((together.J - alone.J).norm() < 1e-12 * alone.J.norm());
  RC_ASSERT((together.J_s_g - alone.J_s_g).norm() < 1e-12 * alone.J_s_g.norm());
  RC_ASSERT(difference_in_sigmas(together.C, alone.C) < 1e-9);
}

RC_GTEST_PROP(PreintegrationProperty, JoinEqualsDirectIntegration, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(41, 0.005, random);
  const int cut = *rc::gen::inRange(1, 40);
  const Vec3 b_a = random.gaussian(0.1), b_g = random.gaussian(0.05);
  Preintegration joined, second;
  joined.reset(b_a, b_g);
  integrate(s, 0, cut, kDefaultNoise, joined);
  second.reset(b_a, b_g);
  integrate(s, cut, s.count - 1, kDefaultNoise, second);
  joined.join(second);
  const Preintegration direct = integrated(s, b_a, b_g, kDefaultNoise);
  RC_ASSERT(std::abs(joined.T - direct.T) < 1e-12);
  RC_ASSERT((joined.dp - direct.dp).norm() < 1e-9);
  RC_ASSERT((joined.dv - direct.dv).norm() < 1e-9);
  RC_ASSERT((joined.dR - direct.dR).norm() < 1e-9);
  RC_ASSERT((joined.J - direct.J).norm() < 1e-9);
  RC_ASSERT(difference_in_sigmas(joined.C, direct.C) < 1e-6);
}

// The second interval was linearised elsewhere: joining moves it to the first one's biases, exact to first order.
RC_GTEST_PROP(PreintegrationProperty, JoinMovesTheSecondIntervalToTheBiasesOfTheFirst, (std::uint32_t seed)) {
  Random random(seed);
  const Readings s = agile_readings(41, 0.005, random);
  const Vec3 b_a = random.gaussian(0.1), b_g = random.gaussian(0.05), d_a = random.gaussian(0.02),
             d_g = random.gaussian(0.002);
  Preintegration joined, second;
  joined.reset(b_a, b_g);
  integrate(s, 0, 20, kDefaultNoise, joined);
  second.reset(b_a + d_a, b_g + d_g);
  integrate(s, 20, 40, kDefaultNoise, second);
  joined.join(second);
  const Preintegration direct = integrated(s, b_a, b_g, kDefaultNoise);
  RC_ASSERT((joined.b_a - b_a).norm() == 0 && (joined.b_g - b_g).norm() == 0);
  RC_ASSERT((joined.dp - direct.dp).norm() < 2e-5);  // the shift itself is 1e-4 and more
  RC_ASSERT((joined.dv - direct.dv).norm() < 2e-4);
  RC_ASSERT((joined.dR - direct.dR).norm() < 2e-5);
}

}  // namespace
}  // namespace epiline::test
