// docs/derivations/imu.md
#include "estimator/inertial/stationary.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>

#include "tests/estimator/inertial/random_interval.h"
#include "tests/support/recorded_data.h"

namespace epiline::test {
namespace {

constexpr double kRate = 200;
const ImuNoise kNoise{};

ImuSample sample(double t, const Vec3& w, const Vec3& a) {
  return {HostStamp{1'000'000'000 + Span::from_seconds(t).ns}, {w.x(), w.y(), w.z()}, {a.x(), a.y(), a.z()}};
}

/// Readings at rest with the noise densities of `kNoise` times `factor` and a large bias.
struct Rest {
  Random random{11};
  double factor = 1;
  const Vec3 b_g{0.05, -0.1, 0.08}, f{0.5, -0.3, 9.7};
  Vec3 w() { return b_g + random.gaussian(factor * kNoise.gyroscope_density * std::sqrt(kRate)); }
  Vec3 a() { return f + random.gaussian(factor * kNoise.accelerometer_density * std::sqrt(kRate)); }
};

TEST(Stationary, RestWithALargeGyroscopeBiasIsRest) {
  Rest rest;
  StationaryDetector detector(kNoise);
  int moving = 0;
  for (int k = 0; k < 20000; ++k) {
    detector.add(sample(k / kRate, rest.w(), rest.a()));
    if (k >= 100 && !detector.is_stationary()) ++moving;
  }
  EXPECT_EQ(moving, 0);
}

TEST(Stationary, RestIsFoundAtEveryRate) {
  for (const double rate : {50.0, 1000.0, 2000.0, 2500.0, 4000.0, 8000.0, 10'000.0}) {
    Rest rest;
    rest.factor = std::sqrt(rate / kRate);
    StationaryDetector detector(kNoise);
    int at_rest = 0;
    const int readings = static_cast<int>(2 * rate);
    for (int k = 0; k < readings; ++k) {
      detector.add(sample(k / rate, rest.w(), rest.a()));
      if (k > readings / 2) at_rest += detector.is_stationary() ? 1 : 0;
    }
    EXPECT_EQ(at_rest, readings - readings / 2 - 1) << rate;
    for (int k = 0; k < static_cast<int>(0.2 * rate); ++k)
      detector.add(sample(2 + k / rate, rest.w() + Vec3(2.0 * k / rate, 0, 0), rest.a()));
    EXPECT_FALSE(detector.is_stationary()) << rate;
  }
}

TEST(Stationary, StatisticsAreThoseOfTheNoise) {
  Rest rest;
  StationaryDetector detector(kNoise);
  for (int k = 0; k < 300; ++k) detector.add(sample(k / kRate, rest.w(), rest.a()));
  const ImuStatistics s = detector.statistics();
  EXPECT_EQ(s.count, 101);
  EXPECT_NEAR(s.duration_s, 0.5, 1e-9);
  const double sigma_w = kNoise.gyroscope_density * std::sqrt(kRate),
               sigma_a = kNoise.accelerometer_density * std::sqrt(kRate);
  // Five standard deviations: sigma/sqrt(n) of a mean, sigma/sqrt(2*3n) of a standard deviation over three axes.
  EXPECT_LT((s.mean_rate - rest.b_g).cwiseAbs().maxCoeff(), 5 * sigma_w / std::sqrt(101));
  EXPECT_LT((s.mean_specific_force - rest.f).cwiseAbs().maxCoeff(), 5 * sigma_a / std::sqrt(101));
  EXPECT_NEAR(s.sigma_rate, sigma_w, 5 * sigma_w / std::sqrt(606));
  EXPECT_NEAR(s.sigma_specific_force, sigma_a, 5 * sigma_a / std::sqrt(606));
}

TEST(Stationary, SmallMotionOfEitherKindIsMotion) {
  for (const bool turning : {false, true}) {
    Rest rest;
    StationaryDetector detector(kNoise);
    int still = 0;
    for (int k = 0; k < 1000; ++k) {
      const double s = std::sin(2 * 3.14159 * 2 * k / kRate);
      detector.add(sample(k / kRate, rest.w() + Vec3::UnitX() * (turning ? 0.05 * s : 0),
                          rest.a() + Vec3::UnitY() * (turning ? 0 : 0.5 * s)));
      still += detector.is_stationary();
    }
    EXPECT_EQ(still, 0) << turning;
  }
}

TEST(Stationary, NoiseFarAboveTheDensitiesIsMotion) {
  Rest rest;
  rest.factor = 8;
  StationaryDetector detector(kNoise);
  for (int k = 0; k < 300; ++k) detector.add(sample(k / kRate, rest.w(), rest.a()));
  EXPECT_FALSE(detector.is_stationary());
}

TEST(Stationary, NeedsAFilledWindowWithoutGap) {
  Rest rest;
  StationaryDetector detector(kNoise);
  double t = 0;
  const auto run = [&](double seconds) {
    for (const double end = t + seconds; t < end; t += 1 / kRate) detector.add(sample(t, rest.w(), rest.a()));
    return detector.is_stationary();
  };
  EXPECT_FALSE(run(0.4));
  EXPECT_TRUE(run(0.2));
  t += 0.11;  // a gap, short enough for the window to reach across it
  EXPECT_FALSE(run(0.38));
  EXPECT_TRUE(run(0.2));
  detector.clear();
  EXPECT_FALSE(run(0.4));
}

TEST(Stationary, AFastSensorFillsTheRing) {
  Rest rest;
  StationaryDetector detector(kNoise);
  for (int k = 0; k < 5000; ++k) detector.add(sample(k / 2000.0, rest.w(), rest.a()));
  EXPECT_EQ(detector.statistics().count, 1001);
  EXPECT_TRUE(detector.is_stationary());
}

// EuRoC MH_01: in the air until 1403636599.9, standing from about 602.5 on, bumped at 610.8.
TEST(Stationary, SeparatesFlightFromStandstillOnARecordedFlight) {
  const std::string path = recorded_data("euroc_MH_01/mav0/imu0/data.csv");
  std::ifstream file(path);
  if (!file) GTEST_SKIP() << "no recorded data at " << path;
  StationaryDetector detector(kNoise);
  int flying = 0, flying_called_still = 0, standing = 0, standing_called_still = 0;
  for (std::string line; std::getline(file, line);) {
    long long t = 0;
    Vec3 w, a;
    if (std::sscanf(line.c_str(), "%lld,%lf,%lf,%lf,%lf,%lf,%lf", &t, &w.x(), &w.y(), &w.z(), &a.x(), &a.y(), &a.z()) !=
        7)
      continue;
    detector.add({HostStamp{t}, {w.x(), w.y(), w.z()}, {a.x(), a.y(), a.z()}});
    const double s = static_cast<double>(t - 1403636584'000000000) * 1e-9;
    const bool still = detector.is_stationary();
    if (s > 0.5 && s < 15.9) {
      ++flying;
      flying_called_still += still;
    } else if (s > 18.5 && s < 26) {
      ++standing;
      standing_called_still += still;
    }
  }
  EXPECT_GT(flying, 3000);
  EXPECT_EQ(flying_called_still, 0);
  EXPECT_GT(standing, 1400);
  EXPECT_EQ(standing_called_still, standing);
}

}  // namespace
}  // namespace epiline::test
