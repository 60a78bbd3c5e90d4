// Which readings are corrupt? Signals whose truth is known: smooth, vibrating, an impact, rounded; with and without
// spikes.
#include "estimator/inertial/spike_judge.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/estimator/made_up_time.h"

namespace epiline::test {
namespace {

using Past = SpikeJudge::Past;

struct Reading {
  double t = 0;
  Vec3 w, a;
};
struct Final {
  std::vector<bool> spike;  ///< of each reading, once its neighbours were seen
  int suspects = 0, gaps = 0;
  bool persists = false;  ///< at any time
};

Final judged(const std::vector<Reading>& readings) {
  SpikeJudge judge;
  ReadingPeriod period;
  Final f;
  for (const Reading& r : readings) {
    const auto v = judge.step(at(r.t), r.w, r.a, period.step(at(r.t)));
    const std::size_t n = f.spike.size(), past = static_cast<std::size_t>(v.past_count);
    if (v.past != Past::kOpen)
      for (std::size_t i = n - past; i < n; ++i) f.spike[i] = v.past != Past::kReal;
    if (v.base_is_spike) f.spike[n - past - 1] = true;
    f.spike.push_back(v.suspect);
    f.suspects += v.suspect;
    f.gaps += v.past == Past::kGap;
    f.persists |= judge.persists();
  }
  return f;
}

int count(const std::vector<bool>& flags) { return static_cast<int>(std::count(flags.begin(), flags.end(), true)); }

/// A flight in the hand or in the air: smooth, with a vibration and noise on top.
std::vector<Reading> flight(double rate_hz, double seconds, double vibration_w, double vibration_a, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::vector<Reading> list;
  for (int i = 0; i < rate_hz * seconds; ++i) {
    const double t = i / rate_hz, shake = std::sin(2 * M_PI * 83 * t);
    const auto random3 = [&] { return Vec3(noise(random), noise(random), noise(random)); };
    const Vec3 w(2 * std::sin(3 * t), 1.5 * std::cos(2 * t), std::sin(t));
    const Vec3 a(4 * std::sin(2 * t), 3 * std::cos(3 * t), 9.8 + 2 * std::sin(4 * t));
    list.push_back({t, w + (0.003 + vibration_w) * random3() + Vec3::Constant(vibration_w * shake),
                    a + (0.03 + vibration_a) * random3() + Vec3::Constant(vibration_a * shake)});
  }
  return list;
}

double any_rate() { return *rc::gen::element(100., 200., 400., 1000., 2000.); }

RC_GTEST_PROP(SpikeJudge, SuspectsNothingInFlightsThatVibrate, ()) {
  const double strength = *rc::gen::element(0., 0.3, 1., 3.);
  const auto f = judged(flight(any_rate(), 5, 0.05 * strength, 1.5 * strength, *rc::gen::arbitrary<unsigned>()));
  RC_ASSERT(count(f.spike) <= 3);  // in the first tenths of a second, before the vibration is known
  RC_ASSERT(f.gaps == 0);
  RC_ASSERT(!f.persists);
}

RC_GTEST_PROP(SpikeJudge, FindsASingleSpikeAndNothingElse, ()) {
  auto readings = flight(any_rate(), 3, 0.03, 1, *rc::gen::arbitrary<unsigned>());
  const auto i = *rc::gen::inRange<std::size_t>(0, readings.size() - 1);
  const bool of_rate = *rc::gen::arbitrary<bool>();
  const int axis = *rc::gen::inRange(0, 3);
  const double size =
      (*rc::gen::arbitrary<bool>() ? 1 : -1) * *rc::gen::element(1., 3., 10., 100.) * (of_rate ? 3 : 60);
  (of_rate ? readings[i].w : readings[i].a)[axis] += size;
  const Final f = judged(readings);
  for (std::size_t k = 0; k < readings.size(); ++k) RC_ASSERT(f.spike[k] == (k == i));
  RC_ASSERT(!f.persists);
}

TEST(SpikeJudge, SeveralSpikesASecondAreFoundAndPersist) {
  for (const double a_second : {1., 8.}) {
    auto readings = flight(200, 10, 0.05, 1.5, 1);
    std::vector<bool> spikes(readings.size());
    for (double t = 1; t < 9.5; t += 1 / a_second) {
      const auto i = static_cast<std::size_t>(200 * t);
      readings[i].w.y() += 35;
      spikes[i] = true;
    }
    const Final f = judged(readings);
    EXPECT_EQ(f.spike, spikes) << a_second;
    EXPECT_EQ(f.persists, a_second > 5) << a_second;
  }
}

/// A blow rings for some readings: all of them were measured.
TEST(SpikeJudge, AnImpactIsReal) {
  for (const double rate_hz : {200., 1000.}) {
    auto readings = flight(rate_hz, 4, 0.005, 0.1, 2);
    for (Reading& r : readings) {
      const double since = r.t - 2;
      if (since < 0) continue;
      r.a.z() += 60 * std::exp(-since / 0.02) * std::sin(2 * M_PI * 18 * since);
      r.w.x() += 3 * std::exp(-since / 0.03) * std::sin(2 * M_PI * 12 * since);
    }
    const Final f = judged(readings);
    EXPECT_EQ(count(f.spike), 0) << rate_hz;
    EXPECT_EQ(f.gaps, 0) << rate_hz;
  }
}

TEST(SpikeJudge, AStepToAnotherLevelIsReal) {
  auto readings = flight(200, 4, 0.005, 0.1, 3);
  for (Reading& r : readings)
    if (r.t >= 2) r.a.x() += 40;
  const Final f = judged(readings);
  EXPECT_EQ(f.suspects, 1);
  EXPECT_EQ(count(f.spike), 0);
}

TEST(SpikeJudge, AFewCorruptReadingsInARowAreBridged) {
  auto readings = flight(200, 4, 0.03, 1, 4);
  readings[400].w.x() += 35;
  readings[401].w.y() -= 20;
  readings[402].a.z() += 500;
  const Final f = judged(readings);
  EXPECT_EQ(count(f.spike), 3);
  EXPECT_TRUE(f.spike[400] && f.spike[401] && f.spike[402]);
}

/// Where all readings are corrupt there is nothing to bridge with: the time is a gap, and afterwards all is well again.
TEST(SpikeJudge, ALongBurstIsAGap) {
  auto readings = flight(200, 4, 0.03, 1, 5);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> any(-80, 80);
  for (std::size_t i = 400; i < 440; ++i) readings[i].w = Vec3(any(random), any(random), any(random));
  const Final f = judged(readings);
  EXPECT_GE(f.gaps, 4);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const bool corrupt = i >= 400 && i < 440, recovering = i >= 440 && i < 450;
    if (!recovering) {
      EXPECT_EQ(f.spike[i], corrupt) << i;
    }
  }
}

TEST(SpikeJudge, TheFirstReadingMayBeTheCorruptOne) {
  auto readings = flight(200, 1, 0.03, 1, 6);
  readings[0].a.y() += 300;
  readings[0].w.y() += 5;
  const Final f = judged(readings);
  EXPECT_TRUE(f.spike[0]);
  EXPECT_EQ(count(f.spike), 1);
}

TEST(SpikeJudge, AReadingAfterAHoleMayBeAnything) {
  auto readings = flight(200, 4, 0.005, 0.1, 7);
  readings.erase(readings.begin() + 300, readings.begin() + 340);
  for (std::size_t i = 300; i < readings.size(); ++i) readings[i].w.x() += 3;
  EXPECT_EQ(judged(readings).suspects, 0);
}

/// The coarse IMU of a rover: 0.15 m/s^2 a step, 100 Hz.
TEST(SpikeJudge, RoundingIsNoSpike) {
  auto readings = flight(100, 20, 0.002, 0.1, 8);
  for (Reading& r : readings) {
    for (double& a : r.a) a = 0.1533 * std::round(a / 0.1533);
    for (double& w : r.w) w = 0.01 * std::round(w / 0.01);
  }
  EXPECT_EQ(judged(readings).suspects, 0);
  readings[1000].a.x() += 20;
  EXPECT_TRUE(judged(readings).spike[1000]);
}

TEST(SpikeJudge, MotorsThatStartAreNoFault) {
  auto readings = flight(200, 6, 0, 0, 9);
  const auto after = flight(200, 6, 0.05, 2.5, 9);
  for (std::size_t i = 600; i < readings.size(); ++i) readings[i] = after[i];
  const Final f = judged(readings);
  EXPECT_LE(count(f.spike), 10);
  EXPECT_EQ(f.gaps, 0);
}

/// What is put in place of a suspect may be off by as much as the suspect was, if that was not absurd.
TEST(SpikeJudge, WhatIsUnknownIsTheSizeOfTheSuspect) {
  SpikeJudge judge;
  Vec3 w = Vec3::Zero();
  const Vec3 a(0, 0, 9.8);
  for (int i = 0; i < 400; ++i) judge.step(at(0.005 * i), w + 0.01 * Vec3::Random(), a + 0.05 * Vec3::Random(), false);
  w.x() = 1.5;
  auto v = judge.step(at(2), w, a, false);
  ASSERT_TRUE(v.suspect);
  EXPECT_NEAR(v.unknown.rate_rad_s, 1.5, 0.05);
  EXPECT_LT(v.unknown.force_m_s2, 0.3);
  v = judge.step(at(2.005), Vec3::Zero(), a, false);
  ASSERT_EQ(v.past, Past::kSpikes);
  EXPECT_NEAR(v.unknown.rate_rad_s, 1.5, 0.05);
  w.x() = 90;
  judge.step(at(2.01), w, a, false);
  v = judge.step(at(2.015), Vec3::Zero(), a, false);
  EXPECT_LT(v.unknown.rate_rad_s, 3);
}

TEST(SpikeJudge, ImpossibleIsWhatNoSensorMeasures) {
  const Vec3 w(0.1, -0.2, 0.3), a(1, 2, 9.8);
  EXPECT_FALSE(is_impossible(w, a));
  EXPECT_FALSE(is_impossible(Vec3::Zero(), a));
  EXPECT_FALSE(is_impossible(w, Vec3::Zero()));
  EXPECT_FALSE(is_impossible(Vec3(99, 0, 0), Vec3(0, -990, 0)));
  EXPECT_TRUE(is_impossible(Vec3::Zero(), Vec3::Zero()));
  EXPECT_TRUE(is_impossible(Vec3(0, 101, 0), a));
  EXPECT_TRUE(is_impossible(w, Vec3(0, 0, -1001)));
  EXPECT_TRUE(is_impossible(Vec3(0, std::nan(""), 0), a));
  EXPECT_TRUE(is_impossible(w, Vec3(std::numeric_limits<double>::infinity(), 0, 0)));
}

}  // namespace
}  // namespace epiline::test
