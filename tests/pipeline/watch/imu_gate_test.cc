#include "pipeline/watch/imu_gate.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace epiline {
namespace {

constexpr ImuLimits kNoLimits;
constexpr std::int64_t kPeriod_ns = 5'000'000;

/// Readings with noise, rounded as a sensor rounds them.
ImuSample reading(int i, double step = 0.002) {
  static std::mt19937_64 random(9);
  static std::normal_distribution<double> noise(0, 1);
  ImuSample r;
  r.stamp = r.arrival = HostStamp{kStart_ns + i * kPeriod_ns};
  for (double& w : r.angular_velocity_rad_s) w = step * std::round(0.003 * noise(random) / step);
  for (double& a : r.specific_force_m_s2) a = step * std::round(0.03 * noise(random) / step);
  r.specific_force_m_s2[2] += 9.81;
  return r;
}

std::uint32_t says(ImuGate& gate, ImuSample r) { return gate.step(r) ? r.reasons : ~0U; }

TEST(ImuGate, RoundedReadingsAtRestAreWell) {
  for (const double step : {1e-6, 0.002, 0.01}) {
    ImuGate gate(kNoLimits);
    for (int i = 0; i < 20'000; ++i) ASSERT_EQ(says(gate, reading(i, step)), 0U) << i << " rounded to " << step;
  }
}

/// Four values between each two of the sensor's: where two of its readings are equal, six values are.
TEST(ImuGate, ReadingsInterpolatedToAHigherRateAreWell) {
  for (const double step : {1e-6, 0.002, 0.01}) {
    ImuGate gate(kNoLimits);
    ImuSample a = reading(0, step);
    for (int i = 1; i < 10'000; ++i) {
      const ImuSample b = reading(i, step);
      for (int k = 0; k < 5; ++k) {
        ImuSample r = a;
        r.stamp = r.arrival = HostStamp{kStart_ns + i * kPeriod_ns + k * kPeriod_ns / 5};
        for (std::size_t j = 0; j < 3; ++j) {
          r.angular_velocity_rad_s[j] += 0.2 * k * (b.angular_velocity_rad_s[j] - a.angular_velocity_rad_s[j]);
          r.specific_force_m_s2[j] += 0.2 * k * (b.specific_force_m_s2[j] - a.specific_force_m_s2[j]);
        }
        ASSERT_EQ(says(gate, r), 0U) << i << " rounded to " << step;
      }
      a = b;
    }
  }
}

TEST(ImuGate, WhatNoSensorMeasuresIsLeftOutAndToldWithTheNext) {
  ImuGate gate({4, 80});
  for (int i = 0; i < 50; ++i) says(gate, reading(i));
  ImuSample zeros = reading(50), beyond = reading(51);
  zeros.angular_velocity_rad_s = zeros.specific_force_m_s2 = {};
  beyond.angular_velocity_rad_s[2] = -7;
  EXPECT_FALSE(gate.step(zeros));
  EXPECT_FALSE(gate.step(beyond));
  EXPECT_EQ(says(gate, reading(52)), bit(HealthReason::kReadingsRefused));
  EXPECT_EQ(says(gate, reading(53)), 0U);
  EXPECT_EQ(gate.stats().impossible, 2U);
}

TEST(ImuGate, ASpikeASecondIsCountedAndSeveralAreNamed) {
  for (const int readings_apart : {200, 25}) {
    ImuGate gate(kNoLimits);
    std::uint32_t said = 0;
    for (int i = 0; i < 2000; ++i) {
      ImuSample r = reading(i, 1e-6);
      if (i % readings_apart == 20) r.angular_velocity_rad_s[1] += 20;
      said |= says(gate, r);
    }
    EXPECT_EQ(gate.stats().spikes, 2000U / readings_apart);
    EXPECT_EQ(said, readings_apart < 100 ? bit(HealthReason::kReadingsRefused) : 0U);
  }
}

TEST(ImuGate, NotANumberIsLeftOutAndToldWithTheNext) {
  ImuGate gate(kNoLimits);
  for (int i = 0; i < 50; ++i) says(gate, reading(i));
  ImuSample bad = reading(50);
  bad.specific_force_m_s2[1] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(gate.step(bad));
  EXPECT_EQ(says(gate, reading(51)), bit(HealthReason::kReadingsRefused));
  EXPECT_EQ(says(gate, reading(52)), 0U);
  EXPECT_EQ(gate.stats().not_finite, 1U);
}

// Without the gate one such stamp makes every later one out of order.
TEST(ImuGate, AStampInTheFutureDoesNotHideWhatFollows) {
  ImuGate gate(kNoLimits);
  for (int i = 0; i < 50; ++i) says(gate, reading(i));
  ImuSample future = reading(50);
  future.stamp = future.stamp + Span::from_milliseconds(10'000);
  EXPECT_FALSE(gate.step(future));
  ImuSample next = reading(51);
  ASSERT_TRUE(gate.step(next));
  EXPECT_EQ(next.stamp.ns, kStart_ns + 51 * kPeriod_ns);
}

/// Of a driver that hands on what it finds: one time for all that came together.
TEST(ImuGate, ReadingsOfOneTimeAreReadingsUnlessTheyAreTheSame) {
  ImuGate gate(kNoLimits);
  int used = 0;
  for (int i = 0; i < 400; ++i) {
    ImuSample r = reading(i, 1e-6);
    r.stamp = r.arrival = HostStamp{kStart_ns + (i - i % 4 + 3) * kPeriod_ns};
    ImuSample again = r;
    if (gate.step(r) && i >= 100) ++used;
    EXPECT_FALSE(gate.step(again));
  }
  EXPECT_EQ(used, 300);
}

TEST(ImuGate, ReadingsAtAKnownLimitAreSaturated) {
  ImuGate gate({4, 80});
  for (int i = 0; i < 50; ++i) says(gate, reading(i));
  ImuSample r = reading(50);
  r.angular_velocity_rad_s[0] = -4;
  EXPECT_EQ(says(gate, r), bit(HealthReason::kImuSaturated));
  EXPECT_EQ(says(gate, reading(51)), 0U);
}

TEST(ImuGate, ReadingsAtAnUnknownLimitAreSaturatedAfterAFew) {
  ImuGate gate(kNoLimits);
  for (int i = 0; i < 2000; ++i) says(gate, reading(i, 1e-6));
  std::uint32_t said = 0;
  for (int i = 2000; i < 2008; ++i) {
    ImuSample r = reading(i, 1e-6);
    r.angular_velocity_rad_s[0] = 0.3;
    said = says(gate, r);
  }
  EXPECT_EQ(said, bit(HealthReason::kImuSaturated));
  EXPECT_EQ(says(gate, reading(2008)), 0U);
}

TEST(ImuGate, TheSameReadingAgainAndAgainIsStuck) {
  ImuGate gate(kNoLimits);
  for (int i = 0; i < 50; ++i) says(gate, reading(i));
  const ImuSample first = reading(50);
  std::uint32_t said = 0;
  for (int i = 50; i < 60; ++i) {
    ImuSample r = first;
    r.stamp = r.arrival = HostStamp{kStart_ns + i * kPeriod_ns};
    said = says(gate, r);
  }
  EXPECT_EQ(said, bit(HealthReason::kImuStuck));
  EXPECT_EQ(says(gate, reading(60)), 0U);
}

// Five in a row, and 20 ms: a slow sensor is stuck at the fifth, a fast one after the time.
TEST(ImuGate, StuckTakesFiveReadingsAndTwentyMilliseconds) {
  struct Case {
    std::int64_t period_ms;
    int well;  ///< readings before the first that is called stuck
  };
  for (const Case c : {Case{10, 4}, Case{5, 4}, Case{1, 20}}) {
    ImuGate gate(kNoLimits);
    for (int i = 0; i < 50; ++i) says(gate, reading(i));
    const ImuSample first = reading(50);
    for (int i = 0; i <= c.well; ++i) {
      ImuSample r = first;
      r.stamp = r.arrival = first.stamp + Span::from_milliseconds(i * c.period_ms);
      EXPECT_EQ((says(gate, r) & bit(HealthReason::kImuStuck)) != 0, i == c.well) << c.period_ms << " ms, " << i;
    }
  }
}

TEST(ImuGate, AClockThatDriftsByMoreThanAHundredMillionthsIsNamed) {
  for (const double ppm : {-110.0, -90.0, 90.0, 110.0}) {
    ImuGate gate(kNoLimits);
    std::uint32_t said = 0;
    for (int i = 0; i < 4000; ++i) {
      ImuSample r = reading(i, 1e-6);
      r.stamp = r.arrival + Span{static_cast<std::int64_t>(1e-6 * ppm * static_cast<double>(i * kPeriod_ns))};
      said |= says(gate, r);
    }
    EXPECT_EQ(said, std::abs(ppm) > 100 ? bit(HealthReason::kImuClockDrift) : 0U) << ppm;
  }
}

TEST(ImuGate, AClockThatStepsIsTakenBackAndNamed) {
  ImuGate gate(kNoLimits);
  for (int i = 0; i < 1300; ++i) {
    ImuSample r = reading(i);
    const std::int64_t truth_ns = r.stamp.ns;
    if (i >= 100) r.stamp = r.stamp - Span::from_milliseconds(500);
    if (!gate.step(r)) continue;
    ASSERT_EQ(r.stamp.ns, truth_ns) << i;
    ASSERT_EQ((r.reasons & bit(HealthReason::kImuClockJump)) != 0, i >= 100 && i < 1101) << i;
  }
  EXPECT_EQ(gate.stats().clock_steps, 1U);
  EXPECT_EQ(gate.stats().suspect, 1U);
}

}  // namespace
}  // namespace epiline
