// The predictor's covariance. Derivation: docs/derivations/prediction.md
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/predict/predictor_fixture.h"

namespace epiline::test {
namespace {

TEST(PredictorCovariance, EqualsNumericalJacobiansAndPreintegratedNoise) {
  Random random(4);
  const Readings s = agile_readings(50, 0.005, random);
  const NavState x0 = some_state(random);
  const Mat16 P0 = some_covariance(random, 0.02, 0.01, 0.05, 0.05, 0.005);
  const auto end = [&](const NavState& from) {
    Predictor predictor(noisy());
    feed(predictor, s, 0, 50);
    predictor.correct(solved(from, at(0), s.w[0] - from.b_g, P0));
    return predictor.odometry();
  };
  const double h = 1e-5;
  Eigen::MatrixXd F = Eigen::MatrixXd::Identity(16, 16);
  for (int i = 0; i < 15; ++i) {
    const Vec15 d = h * Vec15::Unit(i);
    F.col(i).head(15) = difference(state_of(end(displaced(x0, -d))), state_of(end(displaced(x0, d)))) / (2 * h);
  }
  const Preintegration interval = integrated(s, x0.b_a, x0.b_g, noisy().density.noise);
  Eigen::MatrixXd B = Eigen::MatrixXd::Identity(15, 15);
  B.topLeftCorner(3, 3) = B.block(6, 6, 3, 3) = x0.R;
  Eigen::MatrixXd expected = congruence(P0, F.transpose());
  expected.topLeftCorner(15, 15) += congruence(interval.C, B.transpose());
  const Mat16 P = covariance_of(end(x0));
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      EXPECT_NEAR(P(i, j), expected(i, j), 1e-6 * std::sqrt(expected(i, i) * expected(j, j))) << i << " " << j;
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
  return product(lower_factor(P), z);
}

// Mean NEES over 16 dimensions: its standard deviation over 400 runs is 0.018.
TEST(PredictorCovariance, HoldsInMonteCarlo) {
  constexpr int kRuns = 400;
  Random random(5);
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Readings s = agile_readings(61, 0.005, random);
    const NavState x0 = some_state(random);
    const Mat16 P0 = some_covariance(random, 0.003, 0.002, 0.01, 0.05, 0.005);
    const Vec16 error = drawn(P0, random);
    const NoisyFlight flight(s, displaced(x0, error.head<15>()), noisy().density.noise, random);
    Predictor predictor(noisy());
    feed(predictor, flight.measured, 0, 20);
    predictor.correct(solved(x0, at(0), flight.measured.w[0] - x0.b_g, P0));
    feed(predictor, flight.measured, 20, 61);
    const Odometry o = predictor.odometry();
    Vec16 off;
    off << difference(state_of(o), flight.states.back()), error(15);
    nees += chi2(off, covariance_of(o)) / 16 / kRuns;
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
      const Readings s = agile_readings(kLater + 1, 0.005, random);
      const NavState x0 = some_state(random);
      const Mat16 P0 = some_covariance(random, 0.02, 0.005, 0.03, 0.02, 0.002);
      const NoisyFlight flight(s, displaced(x0, drawn(P0, random).head<15>()), noisy().density.noise, random);
      Predictor blended(noisy()), unblended(without_blending(noisy()));
      feed(blended, flight.measured, 0, kImage + 1);
      feed(unblended, flight.measured, 0, kImage + 1);
      blended.correct(solved(x0, at(0), flight.measured.w[0] - x0.b_g, P0));
      const Odometry prior = blended.odometry();
      feed(blended, flight.measured, kImage + 1, kArrival + 1);
      const Eigen::MatrixXd P = covariance_of(prior);
      const Vec3 innovation = flight.states[kImage].p + random.gaussian(kSigma) - state_of(prior).p;
      Eigen::MatrixXd S = P.topLeftCorner(3, 3);
      for (int i = 0; i < 3; ++i) S(i, i) += kSigma * kSigma;
      const Eigen::MatrixXd K = product(P.leftCols(3), inverse(S));
      const NavState x = displaced(state_of(prior), product(K, innovation).topRows(15));
      const Odometry posterior =
          solved(x, at(kImage * s.dt), Vec3(prior.omega_B_rad_s.data()), P - product(K, P.topRows(3)));
      ASSERT_EQ(blended.correct(posterior), Predictor::Correction::kBlended);
      unblended.correct(posterior);
      feed(blended, flight.measured, kArrival + 1, end + 1);
      feed(unblended, flight.measured, kImage + 1, end + 1);
      const Odometry o = blended.odometry();
      const Mat16 more = covariance_of(o) - covariance_of(unblended.odometry());
      EXPECT_GT(least_eigenvalue(more), -1e-12);
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

}  // namespace
}  // namespace epiline::test
