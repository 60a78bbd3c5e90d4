// The prior as a factor: slope and curvature of its cost, a prior from a covariance, and a gauge that is loosened.
// Derivation: docs/derivations/marginalisation.md.
#include "estimator/factors/prior.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cstring>
#include <random>

#include "estimator/solver/chain_equations.h"
#include "tests/estimator/dense_system.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

CalibrationTangent calibration_sigmas() {
  CalibrationTangent s;
  s << 5e-3, Vec3::Constant(0.01), Vec3::Constant(0.02);
  return s;
}

/// Symmetric, positive, with standard deviations as different as those of real states, and correlated.
StateCovariance some_covariance(unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::Matrix<double, 15, 15> A;
  for (int i = 0; i < 15; ++i)
    for (int j = 0; j < 15; ++j) A(i, j) = normal(random);
  Vec15 sigma;
  sigma << Vec3::Constant(0.3), Vec3(2e-3, 3e-3, 2e-2), Vec3::Constant(0.1), Vec3::Constant(2e-2), Vec3::Constant(1e-4);
  StateCovariance P = StateCovariance::Zero();
  P.topLeftCorner<15, 15>() =
      sigma.asDiagonal() * (A * A.transpose() / 15 + 0.2 * Mat15::Identity()) * sigma.asDiagonal();
  P(15, 15) = 25e-6;
  return P;
}

/// H and b of the prior alone, by the map the solver uses.
DenseSystem system_of(const Window& w) {
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

TEST(Prior, SlopeIsThatOfItsCost) {
  SyntheticWindow s = make_window({.frames = 3});
  Window& w = *s.window;
  set_prior(w, some_covariance(1), calibration_sigmas());
  for (int i = 0; i < w.prior.dim(); ++i) w.prior.b[i] = 0.3 * std::sqrt(w.prior.H[i][i]) * std::sin(i);
  w.at(0).x.p += Vec3(0.1, -0.2, 0.05);
  w.at(0).x.v += Vec3(0.02, 0.01, -0.03);
  w.calibration.time_offset += 1e-3;
  const DenseSystem at = system_of(w);
  constexpr double h = 1e-6;
  for (int i = 0; i < 15; ++i) {
    const NavState keep = w.at(0).x;
    double cost[2];
    for (int side = 0; side < 2; ++side) {
      const double step = side ? -h : h;
      if (i < 6)
        retract_pose(w.at(0).x, step * Vec6::Unit(i));
      else
        retract_velocity_biases(w.at(0).x, step * Vec9::Unit(i - 6));
      cost[side] = add_prior(w, nullptr);
      w.at(0).x = keep;
    }
    const int row = i < 6 ? pose_column(3, 0) + i : velocity_row(3, 0) + i - 6;
    const double slope = -0.25 * (cost[0] - cost[1]) / h;
    EXPECT_NEAR(at.b[row], slope, 1e-5 * std::abs(slope) + 1e-6 * std::sqrt(at.H(row, row))) << i;
  }
}

TEST(Prior, FromACovarianceHoldsThatCovariance) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SyntheticWindow s = make_window({.frames = 2});
    Window& w = *s.window;
    const StateCovariance P = some_covariance(seed);
    set_prior(w, P, calibration_sigmas());
    const DenseSystem d = system_of(w);
    std::vector<int> row;
    for (int i = 0; i < 6; ++i) row.push_back(pose_column(2, 0) + i);
    for (int i = 0; i < 9; ++i) row.push_back(velocity_row(2, 0) + i);
    LongMatrix H(15, 15);
    for (int i = 0; i < 15; ++i)
      for (int j = 0; j < 15; ++j) H(i, j) = d.H(row[i], row[j]) * std::sqrt(P(i, i) * P(j, j));
    const LongMatrix C = H.llt().solve(LongMatrix::Identity(15, 15));
    for (int i = 0; i < 15; ++i)
      for (int j = 0; j < 15; ++j)
        EXPECT_NEAR(static_cast<double>(C(i, j)), P(i, j) / std::sqrt(P(i, i) * P(j, j)), 1e-6)
            << seed << ": " << i << ", " << j;
  }
}

/// What loosening adds to a later state's covariance is what drawing worlds says: everything turned about the first
/// frame and shifted.
TEST(Prior, ALooseGaugeMovesTheWholeWorld) {
  SyntheticWindow s = make_window({.frames = 5, .state_error = 0});
  Window& w = *s.window;
  set_initial_prior(w, {}, calibration_sigmas());
  const NavState x = w.at(4).x, x0 = w.at(0).x;
  constexpr double kSigmaP = 0.5, kSigmaYaw = 0.05;
  const StateCovariance added = loosen_gauge(w, x, kSigmaP, kSigmaYaw);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  Eigen::Matrix<double, 9, 9> drawn = Eigen::Matrix<double, 9, 9>::Zero();
  constexpr int kDraws = 40'000;
  for (int n = 0; n < kDraws; ++n) {
    const Mat3 turn = so3_exp(Vec3(0, 0, kSigmaYaw * normal(random)));
    const Vec3 shift = kSigmaP * Vec3(normal(random), normal(random), normal(random));
    Eigen::Matrix<double, 9, 1> d;
    d << x0.p + shift + turn * (x.p - x0.p) - x.p, so3_log(x.R.transpose() * turn * x.R), turn * x.v - x.v;
    drawn += d * d.transpose() / kDraws;
  }
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j)
      EXPECT_NEAR(added(i, j), drawn(i, j), 0.05 * std::sqrt(drawn(i, i) * drawn(j, j)) + 1e-9) << i << ", " << j;
  // and the prior on the first frame knows just that of place and heading, and of tilt what it knew
  const DenseSystem d = system_of(w);
  const int p = pose_column(5, 0);
  const Vec3 up_B = x0.R.transpose() * Vec3::UnitZ();
  EXPECT_NEAR(d.H(p, p), 1 / (kSigmaP * kSigmaP), 1e-9);
  EXPECT_NEAR(up_B.dot(d.H.block<3, 3>(p + 3, p + 3) * up_B), 1 / (kSigmaYaw * kSigmaYaw),
              1e-6 / (kSigmaYaw * kSigmaYaw));
  const Vec3 across = up_B.unitOrthogonal();
  EXPECT_NEAR(across.dot(d.H.block<3, 3>(p + 3, p + 3) * across), 1 / (0.01 * 0.01), 1e-3);
}

TEST(Prior, OfNoFramesCostsNothingAndSaysNothing) {
  SyntheticWindow s = make_window({.frames = 2});
  s.window->prior.frames = 0;
  EXPECT_EQ(add_prior(*s.window, nullptr), 0);
  EXPECT_TRUE(system_of(*s.window).H.isZero(0));
}

}  // namespace
}  // namespace epiline
