// How fast a bias walks, learned from estimates and their covariances. Derivation:
// docs/derivations/imu.md#walk-of-the-biases.
#include "estimator/inertial/bias_walk.h"

#include <gtest/gtest.h>

#include <random>

namespace epiline::test {
namespace {

constexpr double kDensity = 2e-5, kSigma = 5e-5;  // rad/s^2/sqrt(Hz), rad/s

/// After two minutes of estimates, ten a second, of a bias that drifts by so much a second.
BiasWalk warmed(double drift, BiasWalk walk = BiasWalk(100), double seconds = 120) {
  std::mt19937_64 random(5);
  walk.restart();
  std::normal_distribution<double> normal;
  for (int k = 0; k < 10 * seconds; ++k) {
    const double t = 0.1 * k, sigma = kSigma * walk.factor();
    const Vec3 b = drift * t * Vec3::Ones() + 0.3 * kSigma * Vec3(normal(random), normal(random), normal(random));
    walk.add(HostStamp{static_cast<std::int64_t>(1e8) * k + 1}, b, sigma * sigma * Mat3::Identity(),
             kDensity * walk.factor());
  }
  return walk;
}

TEST(BiasWalk, OfASteadySensorIsAsConfigured) { EXPECT_EQ(warmed(0).factor(), 1); }

TEST(BiasWalk, OfASensorThatWarmsUpFollowsIt) {
  for (const double drift : {1e-4, 1e-3}) {
    const double factor = warmed(drift).factor();
    // two seconds of it are then about one standard deviation
    const double sigma = std::hypot(kSigma, kDensity * std::sqrt(2.)) * factor;
    EXPECT_GT(sigma, 0.5 * drift * 2) << drift;
    EXPECT_LT(sigma, 8 * drift * 2) << drift;
  }
}

TEST(BiasWalk, ComesBackAndIsBounded) {
  EXPECT_LE(warmed(1).factor(), 100);
  EXPECT_EQ(warmed(0, warmed(1e-3)).factor(), 1);
}

TEST(BiasWalk, ComparesNoTwoFlights) {
  BiasWalk walk(100);
  walk.add(HostStamp{1}, Vec3::Zero(), Mat3::Identity() * kSigma * kSigma, kDensity);
  walk.restart();
  walk.add(HostStamp{2'500'000'001}, Vec3::Ones(), Mat3::Identity() * kSigma * kSigma, kDensity);
  EXPECT_EQ(walk.factor(), 1);
}

}  // namespace
}  // namespace epiline::test
