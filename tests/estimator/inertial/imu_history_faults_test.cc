// What a history makes of readings that are corrupt, lost, repeated, or part of a blow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "tests/estimator/inertial/history_signal.h"

namespace epiline::test {
namespace {

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

}  // namespace
}  // namespace epiline::test
