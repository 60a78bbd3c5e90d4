// Bounds on densities from readings whose density is known.
#include "estimator/inertial/noise_bounds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace epiline::test {
namespace {

constexpr ImuNoise kTrue{1.5e-4, 2e-5, 1.8e-3, 3e-3};
constexpr double kRate_hz = 200;

/// Ten seconds of readings with white noise of kTrue times `noise`, `added` to each axis; `held`: share of the last
/// value that a filter in the sensor keeps.
NoiseBounds after(double noise, const std::function<double(double)>& added = {}, double held = 0) {
  NoiseBounds bounds;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::array<double, 6> filtered{};
  for (int i = 0; i < 10 * static_cast<int>(kRate_hz); ++i) {
    ImuSample s;
    const double t = i / kRate_hz;
    s.stamp = {1'000'000'000 + static_cast<std::int64_t>(1e9 * t)};
    for (std::size_t k = 0; k < 6; ++k) {
      const double density = noise * (k < 3 ? kTrue.gyroscope_density : kTrue.accelerometer_density);
      filtered[k] = held * filtered[k] + (1 - held) * density * std::sqrt(kRate_hz) * normal(random);
      (k < 3 ? s.angular_velocity_rad_s[k] : s.specific_force_m_s2[k - 3]) = filtered[k] + (added ? added(t) : 0);
    }
    bounds.add(s);
  }
  return bounds;
}

ImuNoise scaled(double factor) {
  return {factor * kTrue.gyroscope_density, factor * kTrue.gyroscope_random_walk, factor * kTrue.accelerometer_density,
          factor * kTrue.accelerometer_random_walk};
}

TEST(NoiseBounds, WhiteNoiseIsSeenAsItIs) {
  const NoiseBounds bounds = after(1);
  // the quietest of forty quarters of a second, of 144 numbers each: some 15 % below
  EXPECT_NEAR(bounds.gyroscope().fine / kTrue.gyroscope_density, 0.87, 0.08);
  EXPECT_NEAR(bounds.accelerometer().fine / kTrue.accelerometer_density, 0.87, 0.08);
  const ImuNoise held = bounds.hold(kTrue);
  EXPECT_EQ(held.gyroscope_density, kTrue.gyroscope_density) << "what is right stays";
  EXPECT_EQ(held.accelerometer_random_walk, kTrue.accelerometer_random_walk);
}

TEST(NoiseBounds, NothingIsHeldBeforeThereAreReadings) {
  const ImuNoise held = NoiseBounds().hold(scaled(100));
  EXPECT_EQ(held.gyroscope_density, scaled(100).gyroscope_density);
}

TEST(NoiseBounds, WrongDensitiesComeNearTheTrueOnes) {
  const NoiseBounds bounds = after(1);
  for (const double factor : {0.01, 0.1, 10., 100.}) {
    const ImuNoise held = bounds.hold(scaled(factor));
    EXPECT_GT(held.gyroscope_density / kTrue.gyroscope_density, 0.7) << factor;
    EXPECT_LT(held.gyroscope_density / kTrue.gyroscope_density, 2.2) << factor;
    EXPECT_GT(held.accelerometer_density / kTrue.accelerometer_density, 0.7) << factor;
    EXPECT_LT(held.accelerometer_density / kTrue.accelerometer_density, 2.2) << factor;
    EXPECT_NEAR(held.gyroscope_random_walk / kTrue.gyroscope_random_walk, 0.9, 0.3) << factor;
    EXPECT_NEAR(held.accelerometer_random_walk / kTrue.accelerometer_random_walk, 0.9, 0.3) << factor;
  }
}

// Users widen densities on purpose, so one that is too large is held at twice what the readings show. The farther
// beyond that limit it is, the less of the widening its walk keeps: none from twice the limit on.
TEST(NoiseBounds, TheWalkOfADensityThatIsTooLargeFallsToThatOfTheReadings) {
  const NoiseBounds bounds = after(1);
  const double limit = bounds.hold(scaled(100)).gyroscope_density / kTrue.gyroscope_density;
  const auto walk = [&](double factor) {
    return bounds.hold(scaled(factor)).gyroscope_random_walk / kTrue.gyroscope_random_walk;
  };
  EXPECT_NEAR(walk(limit), limit, 1e-9);
  EXPECT_NEAR(walk(1.2 * limit), limit / 1.2, 1e-9);
  EXPECT_NEAR(walk(2 * limit), limit / 2, 1e-9);
  EXPECT_NEAR(walk(100), limit / 2, 1e-9);
}

TEST(NoiseBounds, VibrationDoesNotWidenADensityOfAnOrdinarySensor) {
  const auto vibration = [](double t) { return 0.5 * std::sin(2 * std::numbers::pi * 83 * t); };
  const NoiseBounds bounds = after(1, vibration);
  EXPECT_GT(bounds.accelerometer().fine, 10 * kTrue.accelerometer_density);
  const ImuNoise configured{2e-4, 2e-5, 2.5e-3, 3e-3};
  EXPECT_EQ(bounds.hold(configured).gyroscope_density, configured.gyroscope_density);
  EXPECT_EQ(bounds.hold(configured).accelerometer_density, configured.accelerometer_density);
}

TEST(NoiseBounds, AFilterInTheSensorHidesLessFromMeansThanFromReadings) {
  const NoiseBounds bounds = after(1, {}, 0.7);
  EXPECT_LT(bounds.gyroscope().fine, 0.3 * kTrue.gyroscope_density);
  EXPECT_GT(bounds.gyroscope().both, 1.2 * bounds.gyroscope().fine);
  EXPECT_LE(bounds.hold(kTrue).gyroscope_density, kTrue.gyroscope_density);
  EXPECT_GT(bounds.hold(kTrue).gyroscope_density, 0.3 * kTrue.gyroscope_density);
}

TEST(NoiseBounds, ASecondOfNoReadingsIsNoScatter) {
  NoiseBounds bounds = after(1);
  const double before = bounds.accelerometer().fine;
  ImuSample s;
  for (int i = 0; i < 20; ++i) {  // single readings far apart, all the same: nothing is learnt from them
    s.stamp = {20'000'000'000 + 1'000'000'000LL * i};
    bounds.add(s);
  }
  EXPECT_EQ(bounds.accelerometer().fine, before);
}

}  // namespace
}  // namespace epiline::test
