// The prior of the camera's pose on the IMU and of its focal length: how it lets go of a calibration that is wrong. Its
// gradient: gradient_test.cc.
#include "estimator/factors/calibration_prior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

double square(double x) { return x * x; }

SyntheticWindow window_off_by(const CalibrationTangent& d) {
  SyntheticWindow s = make_window({.frames = 3});
  Window& w = *s.window;
  w.calibration_prior.configured = w.calibration;
  w.calibration_prior.rotation.sigma = 1e-3;
  w.calibration_prior.translation.sigma = 2e-3;
  w.calibration_prior.focal.sigma = 4e-3;
  w.calibration_prior.accelerometer_scale.sigma = 5e-3;
  w.calibration_prior.gyroscope_scale.sigma = 6e-3;
  retract(w.calibration, d);
  return s;
}

TEST(CalibrationPrior, HoldsWhatIsNearAndLetsGoOfWhatIsFar) {
  const auto information = [](int column, double off) {
    CalibrationTangent d = CalibrationTangent::Zero();
    d[column] = off;
    SyntheticWindow s = window_off_by(d);
    NamedBlocks blocks;
    add_calibration_prior(*s.window, {s.window->size(), false}, &blocks);
    return blocks.curvature(calibration_of_camera(), column);
  };
  EXPECT_NEAR(information(kRotationColumn + 1, 0), 1 / (1e-3 * 1e-3), 1) << "the standard deviation configured";
  EXPECT_NEAR(information(kFocalColumn, 0), 1 / (4e-3 * 4e-3), 1);
  EXPECT_LT(information(kRotationColumn + 1, 0.35), 1 / (0.15 * 0.15))
      << "20 degrees off, it knows it to 9 degrees only";
  EXPECT_LT(information(kFocalColumn, 0.1), 1 / (0.06 * 0.06));
}

/// What a solve under the prior leaves where the measurements alone say `measured` with a standard deviation `sigma`.
struct Solved {
  CalibrationCovariance covariance = CalibrationCovariance::Identity();
  Calibration calibration;
};
Solved solved_under(const CalibrationPrior& prior, const CalibrationPart& part, double measured, double sigma) {
  const double held = (1 + part.numbers) / (square(part.sigma) * (1 + part.numbers) + square(part.found));
  Solved s;
  s.calibration = prior.configured;
  CalibrationTangent d = CalibrationTangent::Zero();
  const double information = 1 / square(sigma);
  for (int i = 0; i < part.numbers; ++i) s.covariance(part.at + i, part.at + i) = 1 / (information + held);
  d[part.at] = information * measured / (information + held);
  retract(s.calibration, d);
  return s;
}

/// By trying all distances: the likeliest one, if by chi^2 of 30 more than where a descent from the configured values
/// ends, else that.
double expected_distance(const CalibrationPart& p, double measured, double sigma) {
  const auto chi2 = [&](double d) {
    const double n = 1 + p.numbers;
    return square((d - measured) / sigma) + n * std::log1p(square(d) / (square(p.sigma) * n));
  };
  constexpr double kStep = 1e-6;
  double near = 0, best = 0;
  while (chi2(near + kStep) < chi2(near)) near += kStep;
  for (double d = 0; d < 1.1 * measured; d += kStep)
    if (chi2(d) < chi2(best)) best = d;
  return chi2(best) < chi2(near) - 30 ? best : near;
}

/// A local search from the configured values would stay there until the measurements outweigh them.
TEST(CalibrationPrior, FindsATruthThatIsFarOnceItIsClearlyLikelier) {
  CalibrationPrior prior;
  prior.translation.sigma = 5e-4;
  prior.focal.sigma = 1e-4;
  for (CalibrationPart* part : {&prior.translation, &prior.focal}) {
    int jumps = 0, stays = 0;
    for (const double in_sigmas : {2.0, 4.0, 6.0, 9.0, 12.0, 40.0})
      for (const double sigma : {0.003, 0.0006, 0.0001}) {
        const double measured = in_sigmas * sigma, expected = expected_distance(*part, measured, sigma);
        part->found = 0;
        const Solved s = solved_under(prior, *part, measured, sigma);
        const bool farther = look_far(s.covariance, prior.configured, s.calibration, 0.1, prior);
        EXPECT_NEAR(part->found, expected, 0.02 * expected + 1e-6) << in_sigmas << " of " << sigma;
        const double held_at = std::abs(local(prior.configured, s.calibration)[part->at]);
        EXPECT_EQ(farther, part->found > 5 * part->sigma * std::sqrt(1 + part->numbers))
            << in_sigmas << " of " << sigma;
        jumps += part->found > 2 * held_at;
        stays += part->found < 1.1 * held_at;
        const double found = part->found;
        const Solved again = solved_under(prior, *part, measured, sigma);
        const bool news = look_far(again.covariance, prior.configured, again.calibration, 0.1, prior);
        EXPECT_NEAR(part->found, found, 1e-3 * found) << "found again from where it led";
        EXPECT_FALSE(news && farther) << "it was held to that already";
      }
    EXPECT_GT(jumps, 2);
    EXPECT_GT(stays, 2);
    part->found = 0;
  }
}

/// In a steady turn a scale of the gyroscope and its bias are one, and the slope may point anywhere.
TEST(CalibrationPrior, LooksForNoScaleFartherThanItsSlopeLeads) {
  for (const double measured : {-0.46, -0.15, 0.15, 0.46}) {
    CalibrationPrior prior;
    CalibrationPart& part = prior.gyroscope_scale;
    part.sigma = 1e-3;
    const Solved s = solved_under(prior, part, measured, std::abs(measured) / 8);
    const bool in_reach = std::abs(measured) < 0.2;
    EXPECT_EQ(look_far(s.covariance, prior.configured, s.calibration, 0.1, prior), in_reach) << measured;
    EXPECT_NEAR(part.found, in_reach ? std::abs(measured) : 0, 0.01) << measured;
  }
}

/// Long before a truth that is far off is clearly likelier, it may be there: by drawing truths, of all widths alike,
/// and weighing them by the measurement.
TEST(CalibrationPrior, ClaimsWhatTheMeasurementLeavesOpen) {
  CalibrationPrior prior;
  struct Case {
    CalibrationPart& part;
    double sigma, reach;
  };
  for (const Case& c :
       {Case{prior.translation, 5e-4, 1}, Case{prior.focal, 3e-4, 0.2}, Case{prior.gyroscope_scale, 1e-3, 0.2}}) {
    c.part.sigma = c.sigma;
    for (const double measured : {0.0, 0.02, 0.2})
      for (const double sigma : {0.3, 0.05, 0.01}) {
        c.part.found = 0;
        const Solved s = solved_under(prior, c.part, measured * c.reach, sigma * c.reach);
        look_far(s.covariance, prior.configured, s.calibration, 0.1, prior);
        const CalibrationTangent solved = local(prior.configured, s.calibration);
        std::mt19937_64 random(1);
        std::normal_distribution<double> normal;
        std::uniform_real_distribution<double> log_width(std::log(c.sigma), std::log(c.reach));
        double mass = 0, moment = 0;
        for (int i = 0; i < 400'000; ++i) {
          const double width = std::exp(log_width(random));
          CalibrationTangent d = CalibrationTangent::Zero();
          for (int k = 0; k < c.part.numbers; ++k) d[c.part.at + k] = width * normal(random);
          const double off = d[c.part.at] - solved[c.part.at];
          d[c.part.at] -= measured * c.reach;
          const double density = std::exp(-d.squaredNorm() / square(sigma * c.reach) / 2);
          mass += density;
          moment += density * square(off);
        }
        const double claimed = s.covariance(c.part.at, c.part.at) + c.part.doubt(0, 0);
        EXPECT_NEAR(claimed / (moment / mass), 1, 0.35) << c.part.at << ": " << measured << ' ' << sigma;
      }
  }
}

TEST(CalibrationPrior, ClaimsOfAPlaceThatMayBeAnywhereWhatTheSolveDoes) {
  CalibrationPrior prior;
  prior.translation.sigma = 2;
  const Solved s = solved_under(prior, prior.translation, 0.2, 0.01);
  look_far(s.covariance, prior.configured, s.calibration, 0.1, prior);
  EXPECT_LT(prior.translation.doubt.norm(), 1e-6);
}

/// The state that another calibration would mean: the mean of a joint Gaussian under that condition.
TEST(CalibrationPrior, MovesTheStateAsItsCovarianceWithTheCalibrationSays) {
  constexpr int kJoint = 15 + kCalibration, kAt = 15 + kTranslationColumn;
  const Eigen::MatrixXd joint = random_covariance(kJoint, 3), information = inverse(joint);
  CalibrationPrior prior;
  prior.translation.sigma = 1e-3;
  const Vec3 off(0.1, -0.2, 0.05);
  prior.translation.doubt = 0.3 * off * off.transpose();
  const CrossCovariance cross = joint.topRightCorner(16, kCalibration);
  const Eigen::MatrixXd added = product(
      product(cross, growth_by_tails(prior, joint.bottomRightCorner(kCalibration, kCalibration))), cross.transpose());
  const auto rest = [](int i) { return i < kAt ? i : i + 3; };
  Eigen::MatrixXd among(kJoint - 3, kJoint - 3);
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(kJoint - 3);
  for (int i = 0; i < kJoint - 3; ++i) {
    for (int j = 0; j < kJoint - 3; ++j) among(i, j) = information(rest(i), rest(j));
    for (int k = 0; k < 3; ++k) pull[i] -= information(rest(i), kAt + k) * off[k];
  }
  const Eigen::VectorXd moved = solve(among, pull);
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) EXPECT_NEAR(added(i, j), 0.3 * moved[i] * moved[j], 1e-6) << i << ", " << j;
}

/// A lens that is as it was calibrated keeps its claims; of another one more is open than two numbers tell.
TEST(CalibrationPrior, DoubtsWhatElseIsWrongOfALensThatIsNotAsCalibrated) {
  CalibrationPrior prior;
  prior.focal.sigma = prior.shape.sigma = 3e-4;
  prior.translation.sigma = 5e-4;
  prior.accelerometer_scale.sigma = prior.gyroscope_scale.sigma = 1e-3;
  Rig rig;
  Calibration solved;
  CalibrationCovariance covariance = CalibrationCovariance::Zero();
  const auto sigma = [&](int i) { return std::sqrt(doubt_of_lens(prior, solved, covariance, rig)[i]); };
  EXPECT_EQ(doubt_of_lens(prior, solved, covariance, rig), LensDoubt::Zero());
  solved.focal = -0.002;
  for (const int i : {0, 2, 3}) EXPECT_NEAR(sigma(i), 0.002, 1e-12) << i;
  EXPECT_NEAR(sigma(1), 0.002 / 2, 1e-12) << "which changes the local magnification by as much, rms over the image";
  solved.focal = 0;
  solved.shape = 0.001;
  EXPECT_NEAR(sigma(3), 0.002, 1e-12) << "of another shape";
  covariance(kShapeColumn, kShapeColumn) = square(0.00051);
  EXPECT_EQ(sigma(3), 0) << "within two sigmas it is as calibrated";
  solved.focal = 0.05;
  EXPECT_NEAR(sigma(3), 0.004, 1e-12) << "a wrong number says little of the lens' shape";
  prior.gyroscope_scale.sigma = 0;
  EXPECT_EQ(sigma(3), 0) << "not estimated";
  solved.focal = solved.shape = 0;
  rig.use[1] = true;
  rig.poses[1].p_CD = Vec3(0.25, 0, 0);
  EXPECT_NEAR(sigma(0), 0.002, 1e-12) << "two cameras know it as well as their baseline";
}

/// As if the calibration had been measured with so much more noise: the state follows all of the calibration.
TEST(CalibrationPrior, DoubtMovesTheStateWithTheCalibration) {
  const Eigen::MatrixXd joint = random_covariance(16 + kCalibration, 4);
  CalibrationCovariance P = joint.bottomRightCorner(kCalibration, kCalibration);
  CrossCovariance cross = joint.topRightCorner(16, kCalibration);
  const LensDoubt doubt(0.1, 0.4, 0.2, 0.3);
  const Eigen::MatrixXd slopes = product(cross, inverse(P));
  const Eigen::MatrixXd found = product(product(cross, growth_by_doubt(doubt, P)), cross.transpose());
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      double expected = 0;
      for (int k = 0; k < 4; ++k) expected += slopes(i, kFocalColumn + k) * doubt[k] * slopes(j, kFocalColumn + k);
      EXPECT_NEAR(found(i, j), expected, 1e-9) << i << ", " << j;
    }
  for (int c = 0; c < kCalibration; ++c) {  // nothing is estimated
    P.row(c).setZero();
    P.col(c).setZero();
    cross.col(c).setZero();
  }
  EXPECT_TRUE(product(growth_by_doubt(doubt, P), cross.transpose()).isZero(0));
}

TEST(CalibrationPrior, DoubtsForSecondsTheRotationThatAPoorWindowShowsNoMore) {
  CalibrationPrior prior;
  prior.rotation.sigma = 1e-4;
  const Solved clear = solved_under(prior, prior.rotation, 0.0032, 0.0006);
  look_far(clear.covariance, prior.configured, clear.calibration, 0.1, prior);
  const double doubt = prior.rotation.elsewhere;
  ASSERT_GT(doubt, 0.3);
  const Solved poor = solved_under(prior, prior.rotation, 0, 1);
  look_far(poor.covariance, prior.configured, poor.calibration, 1, prior);
  EXPECT_GT(prior.rotation.elsewhere, 0.7 * doubt);
  for (int i = 0; i < 30; ++i) look_far(poor.covariance, prior.configured, poor.calibration, 1, prior);
  EXPECT_LT(prior.rotation.elsewhere, 0.01);
}

TEST(CalibrationPrior, ConcludesNothingFromNextToNothing) {
  CalibrationPrior prior;
  prior.focal.sigma = 3e-5;
  const Solved s = solved_under(prior, prior.focal, 1, 0.05);  // 20 sigmas, but of a measurement that is rounding
  EXPECT_FALSE(look_far(s.covariance, prior.configured, s.calibration, 0.1, prior));
  EXPECT_EQ(prior.focal.found, 0);
}

TEST(CalibrationPrior, GoesWithNoFrameAndOnlyWhereItIsEstimated) {
  SyntheticWindow s = window_off_by(CalibrationTangent::Constant(0.01));
  EXPECT_GT(add_calibration_prior(*s.window, {3, false}, nullptr), 0);
  EXPECT_EQ(add_calibration_prior(*s.window, {3, true}, nullptr), 0);
  s.window->calibration_prior = {};
  EXPECT_EQ(add_calibration_prior(*s.window, {3, false}, nullptr), 0);
}

}  // namespace
}  // namespace epiline::test
