// Integration of stored readings between any two instants against a plain loop; gaps, and readings that must be
// refused.
#include "estimator/inertial/imu_history.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

namespace epiline {
namespace {

Vec3 rate(double t) { return {0.3 * std::sin(2 * t), 0.5 * std::cos(t), -0.2 + 0.1 * t}; }
Vec3 force(double t) { return {std::sin(3 * t), 2 * std::cos(2 * t), 9.8 + 0.3 * std::sin(t)}; }

HostStamp at(double t) { return HostStamp{} + Span::from_seconds(t); }

ImuSample sample(double t) {
  ImuSample s;
  s.stamp = at(t);
  Eigen::Map<Vec3>(s.angular_velocity_rad_s.data()) = rate(t);
  Eigen::Map<Vec3>(s.specific_force_m_s2.data()) = force(t);
  return s;
}

std::unique_ptr<ImuHistory> history(double from, double to, double dt = 0.005) {
  auto h = std::make_unique<ImuHistory>();
  for (int i = 0; from + i * dt <= to + 1e-9; ++i) h->push(sample(from + i * dt));
  return h;
}

const Vec3 kBa(0.1, -0.05, 0.02), kBg(0.01, 0.02, -0.01);

Preintegration integrated(const ImuHistory& h, double t0, double t1) {
  Preintegration z;
  z.reset(kBa, kBg);
  EXPECT_TRUE(h.integrate(at(t0), at(t1), {}, z));
  return z;
}

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

double difference(const Preintegration& a, const Preintegration& b) {
  return (a.dp - b.dp).norm() + (a.dv - b.dv).norm() + so3_log(a.dR.transpose() * b.dR).norm() + std::abs(a.T - b.T);
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

/// Most that may be off with one reading bridged: the signal's curve over two periods.
constexpr double kBridged_m_s = 1e-3;

TEST(ImuHistory, ACorruptReadingIsBridgedAndItsSizeIsUnknown) {
  for (const bool of_rate : {true, false}) {
    const auto good = history(0, 1), bad = std::make_unique<ImuHistory>();
    for (int i = 0; i <= 200; ++i) {
      ImuSample s = sample(0.005 * i);
      if (i == 150) (of_rate ? s.angular_velocity_rad_s : s.specific_force_m_s2)[1] += of_rate ? 35 : 400;
      EXPECT_EQ(bad->push(s), ImuHistory::Push::kTaken);
    }
    EXPECT_EQ(bad->counts().suspects, 1U);
    EXPECT_EQ(bad->counts().bridged, 1U);
    const Preintegration expected = integrated(*good, 0.7, 0.8), z = integrated(*bad, 0.7, 0.8);
    EXPECT_LT((z.dv - expected.dv).norm(), kBridged_m_s);
    EXPECT_LT(so3_log(expected.dR.transpose() * z.dR).norm(), 1e-4);
    const int at_v = 6, at_theta = 3;
    EXPECT_GT(z.C(of_rate ? at_theta : at_v, of_rate ? at_theta : at_v),
              2 * expected.C(of_rate ? at_theta : at_v, of_rate ? at_theta : at_v));
    EXPECT_LT(std::sqrt(z.C(at_v, at_v)), 0.3) << "as much as a spike of 60 m/s^2 might be";
    EXPECT_LT(std::sqrt(z.C(at_theta, at_theta)), 0.05);
    EXPECT_EQ(difference(integrated(*good, 0.8, 0.9), integrated(*bad, 0.8, 0.9)), 0);
    EXPECT_EQ(bad->longest_unknown_s(at(0.7), at(0.8)), good->longest_unknown_s(at(0.7), at(0.8)));
  }
}

/// A blow rings at 70 Hz for 0.1 s, far beyond the sensor's limit, so that every second reading looks like a spike.
TEST(ImuHistory, WhatABlowDoesIsUnknown) {
  constexpr double kLimit = 80, kBegin = 0.7, kEnd = 0.8;
  for (int phase = 0; phase < 8; ++phase) {
    const auto ringing = [phase](double t) {
      if (t <= kBegin || t >= kEnd) return 0.;
      return 150 * std::pow(std::sin(10 * M_PI * (t - kBegin)), 4) * std::sin(2 * M_PI * 70 * t + phase * M_PI / 4);
    };
    const auto calm = history(0, 1), hit = std::make_unique<ImuHistory>();
    for (int i = 0; i <= 200; ++i) {
      ImuSample s = sample(0.005 * i);
      double& x = s.specific_force_m_s2[0];
      x = std::clamp(x + ringing(0.005 * i), -kLimit, kLimit);
      if (std::abs(x) == kLimit) s.reasons = bit(HealthReason::kImuSaturated);
      hit->push(s);
    }
    double dv = 0;
    for (int k = 0; k < 10'000; ++k) dv += 1e-5 * ringing(kBegin + 1e-5 * (k + 0.5));
    const Preintegration z = integrated(*hit, kBegin - 0.05, kEnd + 0.05);
    const double off = z.dv.x() - integrated(*calm, kBegin - 0.05, kEnd + 0.05).dv.x() - dv;
    EXPECT_LT(std::abs(off), 3 * std::sqrt(z.C(6, 6))) << phase;
    EXPECT_LT(std::sqrt(z.C(6, 6)), 3);
  }
}

/// Motors: 83 Hz at 200 readings a second, far stronger than the sensor's noise.
ImuSample vibrating(int i) {
  ImuSample s = sample(0.005 * i);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double shake = std::sin(2 * M_PI * 83 * 0.005 * i + static_cast<double>(axis));
    s.angular_velocity_rad_s[axis] += 0.05 * shake;
    s.specific_force_m_s2[axis] += 1.2 * shake;
  }
  return s;
}

std::unique_ptr<ImuHistory> vibrating_history(int count, const std::function<void(int, ImuSample&)>& spoil) {
  auto h = std::make_unique<ImuHistory>();
  for (int i = 0; i < count; ++i) {
    ImuSample s = vibrating(i);
    spoil(i, s);
    h->push(s);
  }
  return h;
}

/// Within what one reading may differ from the next, so that the judge of beginnings lets it pass.
TEST(ImuHistory, ASpikeWithinTheVibrationIsFoundByTheReadingsAroundIt) {
  const auto good = vibrating_history(800, [](int, ImuSample&) {});
  const auto bad = vibrating_history(800, [](int i, ImuSample& s) {
    if (i == 600) s.specific_force_m_s2[0] += 6;
  });
  EXPECT_EQ(good->counts().bridged, 0U);
  EXPECT_EQ(bad->counts().suspects, 0U);
  EXPECT_EQ(bad->counts().bridged, 1U);
  const Preintegration expected = integrated(*good, 2.9, 3.1), z = integrated(*bad, 2.9, 3.1);
  EXPECT_LT((z.dv - expected.dv).norm(), kBridged_m_s) << "of 0.03 m/s";
  EXPECT_GT(z.C(6, 6), 2 * expected.C(6, 6));
}

/// The line between two readings of a vibration is off by more than its amplitude.
TEST(ImuHistory, OnlyTheCorruptAxisOfAReadingIsReplaced) {
  const auto h = vibrating_history(800, [](int i, ImuSample& s) {
    if (i == 600) s.angular_velocity_rad_s[1] += 35;
  });
  ASSERT_EQ(h->counts().bridged, 1U);
  int seen = 0;
  const ImuSample true_one = vibrating(600);
  h->each(at(3), at(3), [&](const ImuHistory::Reading& r) {
    ++seen;
    EXPECT_EQ(r.a, Vec3(true_one.specific_force_m_s2.data()));
    EXPECT_EQ(r.w.x(), true_one.angular_velocity_rad_s[0]);
    EXPECT_EQ(r.w.z(), true_one.angular_velocity_rad_s[2]);
    EXPECT_NEAR(r.w.y(), true_one.angular_velocity_rad_s[1], 0.04) << "the line would be off by 0.08";
    EXPECT_NE(r.w.y(), true_one.angular_velocity_rad_s[1]);
  });
  EXPECT_EQ(seen, 1);
}

/// A straight line over a place in a vibration leaves out a whole peak, and claims to know it.
TEST(ImuHistory, AReadingThatDidNotComeHasAPlaceAndItsSizeIsUnknown) {
  const auto good = vibrating_history(800, [](int, ImuSample&) {});
  for (const bool refused : {true, false}) {
    const auto bad = std::make_unique<ImuHistory>();
    for (int i = 0; i < 800; ++i) {
      ImuSample s = vibrating(i);
      if (i == 600 && !refused) continue;
      if (i == 600) s.angular_velocity_rad_s[0] = std::nan("");
      bad->push(s);
    }
    const Preintegration expected = integrated(*good, 2.9, 3.1), z = integrated(*bad, 2.9, 3.1);
    EXPECT_LT((z.dv - expected.dv).norm(), 2 * kBridged_m_s) << "the line over it: 0.0138 m/s";
    EXPECT_GT(z.C(6, 6), 2 * expected.C(6, 6));
    EXPECT_LT(std::sqrt(z.C(6, 6)), 0.03) << "the peak of a vibration, for a period";
    EXPECT_EQ(bad->counts().bridged + bad->counts().suspects + bad->counts().gaps, 0U) << "it was not corrupt";
    EXPECT_EQ(difference(integrated(*good, 3.1, 3.2), integrated(*bad, 3.1, 3.2)), 0);
  }
}

TEST(ImuHistory, AFewRepeatedReadingsAreAsGoodAsLost) {
  const auto good = vibrating_history(800, [](int, ImuSample&) {});
  for (const int repeats : {1, 3}) {
    const auto stuck = vibrating_history(800, [&](int i, ImuSample& s) {
      if (i <= 600 || i > 600 + repeats) return;
      s.angular_velocity_rad_s = vibrating(600).angular_velocity_rad_s;
      s.specific_force_m_s2 = vibrating(600).specific_force_m_s2;
    });
    EXPECT_EQ(stuck->counts().bridged, repeats == 1 ? 0U : 3U) << "a single one may be chance";
    EXPECT_EQ(stuck->counts().gaps, 0U);
    const Preintegration expected = integrated(*good, 2.9, 3.1), z = integrated(*stuck, 2.9, 3.1);
    EXPECT_LT((z.dv - expected.dv).norm(), 3 * std::sqrt(z.C.block<3, 3>(6, 6).trace()));
    EXPECT_GT(z.C(6, 6), 2 * expected.C(6, 6));
  }
}

/// A simulated sensor without noise, or one that the watch calls stuck.
TEST(ImuHistory, ReadingsThatOftenRepeatAreTaken) {
  const auto h = std::make_unique<ImuHistory>();
  for (int i = 0; i < 300; ++i) {
    ImuSample s = sample(0.5);
    s.stamp = at(0.005 * i);
    h->push(s);
  }
  const Preintegration z = integrated(*h, 0, 1);
  EXPECT_NEAR((z.dv - integrated(*h, 0.2, 1.2).dv).norm(), 0, 1e-12);
  EXPECT_EQ(h->counts().bridged, 0U);
  EXPECT_NEAR(z.C(6, 6), integrated(*history(0, 2), 0, 1).C(6, 6), 1e-7);
}

/// Before a lost reading, and after it, what corrupt readings say is still of the readings that came.
TEST(ImuHistory, ACorruptReadingBesideALostOneIsStillBridged) {
  for (const int lost : {598, 599, 601, 602}) {
    const auto h = std::make_unique<ImuHistory>();
    for (int i = 0; i < 800; ++i) {
      ImuSample s = vibrating(i);
      if (i == lost) continue;
      if (i == 600) s.specific_force_m_s2[2] += 200;
      h->push(s);
    }
    EXPECT_EQ(h->counts().bridged, 1U);
    const Vec3 true_dv = integrated(*vibrating_history(800, [](int, ImuSample&) {}), 2.9, 3.1).dv;
    EXPECT_LT((integrated(*h, 2.9, 3.1).dv - true_dv).norm(), 0.03) << "two in a row are unknown; the spike is 1 m/s";
  }
}

TEST(ImuHistory, TellsFromWhereOnIntegralsHaveChanged) {
  const auto h = std::make_unique<ImuHistory>();
  for (int i = 0; i <= 600; ++i) {
    ImuSample s = vibrating(i);
    if (i == 600) s.specific_force_m_s2[2] += 200;
    h->push(s);
  }
  EXPECT_FALSE(h->take_revised()) << "nothing was final yet";
  const Preintegration doubted = integrated(*h, 2.9, 3);
  h->push(vibrating(601));
  EXPECT_EQ(h->take_revised(), at(0.005 * 599)) << "corrupt, a line in its place";
  EXPECT_FALSE(h->take_revised());
  h->push(vibrating(602));
  EXPECT_EQ(h->take_revised(), at(0.005 * 599)) << "a likelier value in its place";
  h->push(vibrating(603));
  EXPECT_FALSE(h->take_revised());
  h->push(vibrating(604));
  EXPECT_EQ(h->take_revised(), at(0.005 * 599)) << "surely no motion: less is unknown";
  for (int i = 605; i < 650; ++i) h->push(vibrating(i));
  EXPECT_FALSE(h->take_revised());
  const Preintegration certain = integrated(*h, 2.9, 3);
  EXPECT_GT(std::sqrt(doubted.C(8, 8)), 0.2);
  EXPECT_LT(std::sqrt(certain.C(8, 8)), 0.02);
}

/// An interval that ends at a suspect goes on with the reading before; what the suspect would have added is in the
/// covariance. With the next reading all of it counts.
TEST(ImuHistory, ASuspectThatWasRealCountsOnceTheNextReadingAgrees) {
  const auto h = std::make_unique<ImuHistory>();
  const auto stepped = [](double t) {
    ImuSample s = sample(t);
    if (t > 0.4999) s.angular_velocity_rad_s[0] += 3;
    if (t > 0.4999) s.specific_force_m_s2[2] += 30;
    return s;
  };
  for (int i = 0; i <= 100; ++i) h->push(stepped(0.005 * i));
  ASSERT_TRUE(h->newest_is_suspect());
  const Preintegration doubted = integrated(*h, 0.45, 0.5);
  EXPECT_LT((h->newest().w - rate(0.495)).norm(), 1e-12);
  h->push(stepped(0.505));
  EXPECT_FALSE(h->newest_is_suspect());
  EXPECT_EQ(h->counts().bridged, 0U);
  const Preintegration certain = integrated(*h, 0.45, 0.5);
  const Vec3 missed = certain.dv - doubted.dv, turned = so3_log(doubted.dR.transpose() * certain.dR);
  EXPECT_GT(missed.norm(), 0.05);
  EXPECT_LT(missed.norm(), 2 * std::sqrt(doubted.C(8, 8)));
  EXPECT_GT(turned.norm(), 0.005);
  EXPECT_LT(turned.norm(), 2 * std::sqrt(doubted.C(3, 3)));
  EXPECT_LT(std::sqrt(certain.C(8, 8)), 0.1 * std::sqrt(doubted.C(8, 8)));
}

TEST(ImuHistory, ABurstOfCorruptReadingsIsAGap) {
  const auto h = std::make_unique<ImuHistory>();
  int gaps = 0;
  for (int i = 0; i <= 400; ++i) {
    ImuSample s = sample(0.005 * i);
    if (i >= 200 && i < 300) s.angular_velocity_rad_s[static_cast<std::size_t>(i % 3)] += i % 2 == 0 ? 40 : -30;
    h->push(s);
    gaps += h->after_gap();
  }
  EXPECT_GE(gaps, 10);
  EXPECT_EQ(h->counts().gaps, static_cast<std::uint64_t>(gaps));
  EXPECT_GT(h->longest_unknown_s(at(0.9), at(1.6)), 0.4);
  EXPECT_LT(h->longest_unknown_s(at(1.6), at(1.9)), 0.01);
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
}  // namespace epiline
