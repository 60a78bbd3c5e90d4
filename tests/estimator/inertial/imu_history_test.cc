// Integration of stored readings between any two instants against a plain loop; gaps, and readings that must be
// refused. Corrupt and lost readings: imu_history_faults_test.cc.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "tests/estimator/inertial/history_signal.h"

namespace epiline::test {
namespace {

/// Readings at multiples of dt, interpolated linearly, one midpoint step per piece.
Preintegration plain_loop(double t0, double t1, double dt) {
  auto read = [&](double t, Vec3& w, Vec3& a) {
    const double i = std::floor(t / dt + 1e-9), u = t / dt - i;
    w = (1 - u) * rate(i * dt) + u * rate((i + 1) * dt);
    a = (1 - u) * force(i * dt) + u * force((i + 1) * dt);
  };
  Preintegration z;
  z.reset(kBa, kBg);
  for (double t = t0; t < t1 - 1e-10;) {
    const double next = std::min(t1, dt * (std::floor(t / dt + 1e-7) + 1));
    Vec3 w0, a0, w1, a1;
    read(t, w0, a0);
    read(next, w1, a1);
    z.integrate(w0, a0, w1, a1, next - t, {});
    t = next;
  }
  return z;
}

RC_GTEST_PROP(ImuHistory, IntegratesBetweenAnyInstantsAsAPlainLoopDoes, ()) {
  const auto h = history(0, 2);
  const double t0 = *rc::gen::inRange(0, 1000000) * 1e-6, t1 = t0 + *rc::gen::inRange(1, 900000) * 1e-6;
  const Preintegration a = integrated(*h, t0, t1), b = plain_loop(t0, t1, 0.005);
  RC_ASSERT(difference(a, b) < 1e-6);
  RC_ASSERT(std::abs(a.T - (t1 - t0)) < 1e-8);
  RC_ASSERT((a.C - b.C).norm() < 1e-5 * b.C.norm());
}

RC_GTEST_PROP(ImuHistory, TwoPartsJoinedAreTheWhole, ()) {
  const auto h = history(0, 2);
  const int t0 = *rc::gen::inRange(0, 500000), t1 = t0 + *rc::gen::inRange(1000, 500000),
            t2 = t1 + *rc::gen::inRange(1000, 500000);
  Preintegration joined = integrated(*h, t0 * 1e-6, t1 * 1e-6);
  joined.join(integrated(*h, t1 * 1e-6, t2 * 1e-6));
  // splitting a step in two changes the midpoint rule a little
  RC_ASSERT(difference(joined, integrated(*h, t0 * 1e-6, t2 * 1e-6)) < 1e-5);
}

TEST(ImuHistory, InterpolatesAtBothEnds) {
  const auto h = history(0, 1);
  NavState x;
  Vec3 omega;
  h->propagate(at(0.4), at(0.5025), {}, x, omega);
  EXPECT_TRUE(omega.isApprox(0.5 * (rate(0.5) + rate(0.505)), 1e-9));
  // a piece within one sampling period uses the readings there
  const Preintegration z = integrated(*h, 0.501, 0.502);
  const Vec3 expected = 0.001 * (0.7 * rate(0.5) + 0.3 * rate(0.505) - kBg);
  EXPECT_LT((so3_log(z.dR) - expected).norm(), 1e-9);
}

TEST(ImuHistory, HoldsTheNewestReadingBeyondTheEndButNotForLong) {
  const auto h = history(0, 1);
  const Preintegration z = integrated(*h, 1, 1.003);
  EXPECT_LT((so3_log(z.dR) - 0.003 * (rate(1) - kBg)).norm(), 1e-9);
  EXPECT_NEAR(z.T, 0.003, 1e-12);
  Preintegration out;
  out.reset(kBa, kBg);
  EXPECT_TRUE(h->integrate(at(1), at(1.4), {}, out));
  EXPECT_FALSE(h->integrate(at(1), at(1.6), {}, out));
  EXPECT_FALSE(h->integrate(at(-1), at(-0.6), {}, out));
  EXPECT_FALSE(std::make_unique<ImuHistory>()->integrate(at(0), at(0.1), {}, out));
}

TEST(ImuHistory, PropagatesAsItIntegrates) {
  const auto h = history(0, 2);
  NavState x;
  x.p = Vec3(1, 2, 3);
  x.v = Vec3(0.5, -1, 0.2);
  x.R = so3_exp(Vec3(0.3, 0.2, -1));
  x.b_a = kBa;
  x.b_g = kBg;
  NavState moved = x;
  Vec3 omega;
  h->propagate(at(0.3), at(0.8), {}, moved, omega);
  const Preintegration z = integrated(*h, 0.3, 0.8);
  EXPECT_LT((moved.p - (x.p + x.v * z.T + 0.5 * kGravity_W * z.T * z.T + x.R * z.dp)).norm(), 1e-9);
  EXPECT_LT((moved.v - (x.v + kGravity_W * z.T + x.R * z.dv)).norm(), 1e-9);
  EXPECT_LT(so3_log(moved.R.transpose() * x.R * z.dR).norm(), 1e-9);
}

TEST(ImuHistory, AGapWidensTheCovariance) {
  const auto whole = history(0, 1);
  const auto holed = std::make_unique<ImuHistory>();
  int gaps = 0;
  for (int i = 0; i <= 200; ++i) {
    if (i > 90 && i < 130) continue;  // 0.2 s
    EXPECT_EQ(holed->push(sample(0.005 * i)), ImuHistory::Push::kTaken);
    gaps += holed->after_gap();
  }
  EXPECT_EQ(gaps, 1);
  const Mat15 C = integrated(*whole, 0.4, 0.7).C, D = integrated(*holed, 0.4, 0.7).C;
  // 2 m/s^2 unknown for 0.2 s: 0.4 m/s; 0.5 rad/s: 0.1 rad
  EXPECT_NEAR(std::sqrt(D(6, 6)), 0.4, 0.2);
  EXPECT_NEAR(std::sqrt(D(3, 3)), 0.1, 0.02);
  EXPECT_LT(std::sqrt(C(6, 6)), 0.01);
  EXPECT_TRUE(integrated(*holed, 0.1, 0.4).C.isApprox(integrated(*whole, 0.1, 0.4).C, 1e-9));
}

TEST(ImuHistory, RefusesOldDoubleAndBrokenReadings) {
  const auto h = history(0, 0.1);
  const Preintegration before = integrated(*h, 0.02, 0.09);
  ImuSample s = sample(0.1);
  s.angular_velocity_rad_s[0] = 7;
  EXPECT_EQ(h->push(s), ImuHistory::Push::kDuplicate);
  s.stamp = at(0.0975);
  EXPECT_EQ(h->push(s), ImuHistory::Push::kOutOfOrder);
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    for (int axis = 0; axis < 6; ++axis) {
      s = sample(0.105);
      (axis < 3 ? s.angular_velocity_rad_s : s.specific_force_m_s2)[static_cast<std::size_t>(axis % 3)] = bad;
      EXPECT_EQ(h->push(s), ImuHistory::Push::kNotFinite);
    }
  EXPECT_EQ(difference(integrated(*h, 0.02, 0.09), before), 0);
  EXPECT_EQ(h->newest().stamp, at(0.1));
  EXPECT_EQ(h->push(sample(0.105)), ImuHistory::Push::kTaken);
}

TEST(ImuHistory, RefusesWhatNoSensorMeasures) {
  const auto h = history(0, 0.1);
  ImuSample s = sample(0.105);
  s.specific_force_m_s2[0] = 1e6;
  EXPECT_EQ(h->push(s), ImuHistory::Push::kImpossible);
  s = sample(0.105);
  s.angular_velocity_rad_s[0] = 1e4;
  EXPECT_EQ(h->push(s), ImuHistory::Push::kImpossible);
  s.angular_velocity_rad_s = s.specific_force_m_s2 = {};
  EXPECT_EQ(h->push(s), ImuHistory::Push::kImpossible);
  EXPECT_EQ(h->newest().stamp, at(0.1));
}

TEST(ImuHistory, AStampFarAheadNeedsASecondOneThatConfirmsIt) {
  const auto h = history(0, 0.1);
  EXPECT_EQ(h->push(sample(100)), ImuHistory::Push::kFarAhead);
  EXPECT_EQ(h->push(sample(0.105)), ImuHistory::Push::kTaken);
  EXPECT_FALSE(h->after_gap());
  EXPECT_EQ(h->push(sample(0.8)), ImuHistory::Push::kFarAhead);
  EXPECT_EQ(h->push(sample(200)), ImuHistory::Push::kFarAhead);
  EXPECT_EQ(h->push(sample(0.9)), ImuHistory::Push::kFarAhead);
  EXPECT_EQ(h->push(sample(0.905)), ImuHistory::Push::kTaken);
  EXPECT_TRUE(h->after_gap());
  EXPECT_EQ(h->newest().stamp, at(0.905));
  EXPECT_EQ(h->push(sample(0.91)), ImuHistory::Push::kTaken);
  EXPECT_FALSE(h->after_gap());
}

TEST(ImuHistory, AFirstStampFarAheadDoesNotHideWhatFollows) {
  const auto h = std::make_unique<ImuHistory>();
  EXPECT_EQ(h->push(sample(100)), ImuHistory::Push::kTaken);
  EXPECT_EQ(h->push(sample(0)), ImuHistory::Push::kTaken);
  EXPECT_EQ(h->push(sample(0.005)), ImuHistory::Push::kTaken);
  EXPECT_EQ(h->newest().stamp, at(0.005));
  EXPECT_EQ(h->oldest_stamp(), at(0));
}

/// A first pair of readings that came in one packet, a microsecond apart, must not make gaps of all that follow.
TEST(ImuHistory, LearnsThePeriodWhateverTheFirstOneWas) {
  const auto h = std::make_unique<ImuHistory>();
  h->push(sample(-1e-6));
  int gaps = 0;
  for (int i = 0; i <= 400; ++i) {
    h->push(sample(0.005 * i));
    if (i > 100) gaps += h->after_gap();
  }
  EXPECT_EQ(gaps, 0);
  EXPECT_NEAR(h->period(), 0.005, 0.001);
  EXPECT_LT(std::sqrt(integrated(*h, 1.5, 1.6).C(6, 6)), 0.01);
}

TEST(ImuHistory, ForgetsTheOldestWhenFull) {
  const auto h = history(0, 30);
  EXPECT_GT(h->oldest_stamp(), at(9));
  EXPECT_LT(h->oldest_stamp(), at(10));
  EXPECT_LT(difference(integrated(*h, 29, 29.5), plain_loop(29, 29.5, 0.005)), 1e-6);
  h->clear();
  EXPECT_TRUE(h->empty());
}

TEST(ImuHistory, MeanRateIsThatOfTheReadingsWithin) {
  const auto h = history(0, 1);
  Vec3 sum = Vec3::Zero();
  for (int i = 100; i <= 120; ++i) sum += rate(0.005 * i) - kBg;
  EXPECT_NEAR(h->mean_rate(at(0.5), at(0.6), kBg), sum.norm() / 21, 1e-9);
  EXPECT_EQ(h->mean_rate(at(5), at(6), kBg), 0);
}

}  // namespace
}  // namespace epiline::test
