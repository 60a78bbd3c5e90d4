// The prior as a factor, and a prior from a covariance. Its gradient: gradient_test.cc.
// Derivation: docs/derivations/marginalisation.md.
#include "estimator/factors/prior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "estimator/factors/calibration_prior.h"
#include "estimator/solver/chain_equations.h"
#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

KnownJointly known(const StateCovariance& P) {
  CalibrationTangent s;
  s << 5e-3, Vec3::Constant(1e-4), Vec3::Constant(2e-4), 1e-4, 3e-4, 2e-4, 1e-4;
  return {P, s.cwiseAbs2().asDiagonal(), CrossCovariance::Zero(), CalibrationTangent::Zero(), 5e-3};
}

/// Symmetric, positive, with standard deviations as different as those of real states, and correlated.
StateCovariance some_covariance(unsigned seed) {
  const Eigen::MatrixXd A = random_covariance(15, seed);
  Vec15 sigma;
  sigma << Vec3::Constant(0.3), Vec3(2e-3, 3e-3, 2e-2), Vec3::Constant(0.1), Vec3::Constant(2e-2), Vec3::Constant(1e-4);
  StateCovariance P = StateCovariance::Zero();
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j < 15; ++j) P(i, j) = sigma[i] * sigma[j] * (A(i, j) / 15 + (i == j ? 0.2 : 0));
  P(15, 15) = 25e-6;
  return P;
}

/// H and b of the prior alone, by the map the solver uses.
DenseSystem prior_alone(const Window& w) {
  const auto s = std::make_unique<LinearSystem>();
  s->frames = w.size();
  std::memset(s->S, 0, sizeof s->S);
  std::memset(s->P, 0, sizeof s->P);
  std::memset(s->D, 0, sizeof s->D);
  std::memset(s->C, 0, sizeof s->C);
  std::memset(s->rhs_s, 0, sizeof s->rhs_s);
  std::memset(s->rhs_v, 0, sizeof s->rhs_v);
  ChainEquations equations(*s);
  add_prior(w, &equations);
  return dense(*s);
}

TEST(Prior, FromACovarianceHoldsThatCovariance) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SyntheticWindow s = make_window({.frames = 2});
    Window& w = *s.window;
    const StateCovariance P = some_covariance(seed);
    set_prior(w, known(P));
    const DenseSystem d = prior_alone(w);
    std::vector<int> row;
    for (int i = 0; i < 6; ++i) row.push_back(pose_column(0) + i);
    for (int i = 0; i < 9; ++i) row.push_back(velocity_row(2, 0) + i);
    DenseSystem block{Eigen::MatrixXd(15, 15), Eigen::VectorXd::Zero(15)};
    for (int i = 0; i < 15; ++i)
      for (int j = 0; j < 15; ++j) block.H(i, j) = d.H(row[i], row[j]) * std::sqrt(P(i, i) * P(j, j));
    const Eigen::MatrixXd C = solve_dense(block).covariance;
    for (int i = 0; i < 15; ++i)
      for (int j = 0; j < 15; ++j)
        EXPECT_NEAR(C(i, j), P(i, j) / std::sqrt(P(i, i) * P(j, j)), 1e-6) << seed << ": " << i << ", " << j;
  }
}

/// State and calibration are correlated, and the calibration's own prior, which each solve adds, counts once.
TEST(Prior, HandsOverTheCalibrationWithoutItsOwnPrior) {
  SyntheticWindow s = make_window({.frames = 2});
  Window& w = *s.window;
  w.calibration_prior.configured = w.calibration;
  w.calibration_prior.translation.sigma = 5e-4;
  w.calibration.p_BC += Vec3(3e-4, 0, -2e-4);
  KnownJointly k = known(some_covariance(3));
  k.cross.block<3, 3>(6, kTranslationColumn) = 0.5 * 0.1 * 2e-4 * Mat3::Identity();
  const CalibrationTangent d = local(w.calibration_prior.configured, w.calibration),
                           weight = calibration_prior_information(w.calibration_prior, d);
  k.own = weight;
  set_prior(w, k);
  constexpr int n = 15 + kCalibration;
  Eigen::MatrixXd S(n, n), H(n, n);
  S.topLeftCorner(15, 15) = k.P.topLeftCorner(15, 15);
  S.topRightCorner(15, kCalibration) = k.cross.topRows(15);
  S.bottomLeftCorner(kCalibration, 15) = k.cross.topRows(15).transpose();
  S.bottomRightCorner(kCalibration, kCalibration) = k.calibration;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) H(i, j) = w.prior.H[i][j];
  for (int c = 0; c < kCalibration; ++c) H(15 + c, 15 + c) += weight[c];
  Eigen::VectorXd unit(n);
  for (int i = 0; i < n; ++i) unit[i] = std::sqrt(S(i, i));
  const Eigen::MatrixXd one = product(in_units(H, unit.cwiseInverse()), in_units(S, unit));
  EXPECT_LT((one - Eigen::MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(), 1e-5);
  for (int c = 0; c < kCalibration; ++c)
    EXPECT_NEAR(w.prior.b[15 + c], weight[c] * d[c], 1e-9 * std::abs(weight[c])) << "both pull against each other";
}

/// A vehicle that waits learns nothing about its calibration: only rounding differs from the calibration's own prior.
/// The new window must not hold that prior a second time, or it never finds a truth that is far off.
TEST(Prior, HandsOverNothingOfWhatWasNotLearned) {
  SyntheticWindow s = make_window({.frames = 2});
  Window& w = *s.window;
  CalibrationPrior& own = w.calibration_prior;
  own.configured = w.calibration;
  own.rotation.sigma = 1e-3;
  own.translation.sigma = 5e-4;
  own.focal.sigma = own.shape.sigma = 3e-4;
  own.accelerometer_scale.sigma = own.gyroscope_scale.sigma = 1e-3;
  const CalibrationTangent weight = calibration_prior_information(own, CalibrationTangent::Zero());
  KnownJointly k = known(some_covariance(3));
  CalibrationTangent more = CalibrationTangent::Constant(-1e-6);  // of that weight
  more[kFocalColumn] = -0.5;
  more[kGyroscopeScaleColumn] = 3;
  for (int c = 1; c < kCalibration; ++c) k.calibration(c, c) = 1 / (weight[c] * (1 + more[c]));
  k.own = weight;
  set_prior(w, k);
  for (int c = 1; c < kCalibration; ++c)
    EXPECT_NEAR(w.prior.H[15 + c][15 + c], weight[c] * std::max(0., more[c]), 1e-5 * weight[c]) << c;
}

TEST(Prior, OfNoFramesCostsNothingAndSaysNothing) {
  SyntheticWindow s = make_window({.frames = 2});
  s.window->prior.frames = 0;
  EXPECT_EQ(add_prior(*s.window, nullptr), 0);
  EXPECT_TRUE(prior_alone(*s.window).H.isZero(0));
}

}  // namespace
}  // namespace epiline::test
