// Derivation: docs/derivations/clock_sync.md
#include "platform/time/two_way_sync.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdio>
#include <vector>

#include "tests/platform/time/clock_fixture.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

/// The answers are samples with delays; the questions were sent another delay before.
struct Exchange {
  Arrival answer;
  std::int64_t way_out_ns = 0, least_ns = 0;
  HostStamp sent() const { return answer.host - Span{way_out_ns + least_ns}; }
  HostStamp received() const { return answer.arrival() + Span{least_ns}; }
};

std::vector<Exchange> exchanges(const TrueClock& clock, std::int64_t begin_ns, std::int64_t end_ns,
                                double delay_mean_ns, std::mt19937& random) {
  Traffic traffic;
  traffic.rate_hz = 10;
  traffic.delay_mean_ns = delay_mean_ns;
  traffic.stall_most_ns = 5e7;
  std::exponential_distribution<double> delay(1 / delay_mean_ns);
  std::vector<Exchange> all;
  for (const Arrival& a : traffic.make(clock, begin_ns, end_ns, random))
    all.push_back({a, static_cast<std::int64_t>(delay(random)), 400'000});
  return all;
}

double error_ns(const TwoWaySync& sync, const Exchange& e) {
  return static_cast<double>((sync.translate(e.answer.device) - e.answer.host).ns);
}

TEST(TwoWaySync, OneExchangeGivesTheFormula) {
  TwoWaySync sync({});
  EXPECT_EQ(sync.state().status, ClockStatus::kEmpty);
  const HostStamp sent{1'000'000}, received{5'000'000};
  const DeviceStamp device{50'000'000'000};
  EXPECT_EQ(sync.update(sent, device, received), ClockOutcome::kUsed);
  EXPECT_EQ(sync.state().offset.ns, (sent.ns + received.ns - 2 * device.ns) / 2);
  EXPECT_EQ(sync.state().bound.ns, 2'000'000);
  EXPECT_EQ(sync.translate(device + Span{7}).ns, 3'000'007);
}

// Each bound is a one-way model, so the theorem on its error holds; the middle errs by the mean of both at most.
RC_GTEST_PROP(TwoWaySync, ErrsNoMoreThanTheDelaysAllow, ()) {
  const TrueClock clock = any_clock();
  std::mt19937 random = any_random();
  const auto all = exchanges(clock, 0, 90 * kSecond, *rc::gen::inRange(10'000, 2'000'000), random);
  TwoWaySync sync({});
  std::vector<Arrival> in, out;
  for (const Exchange& e : all) {
    const ClockOutcome outcome = sync.update(e.sent(), e.answer.device, e.received());
    RC_ASSERT((outcome == ClockOutcome::kSlow) == (e.received() - e.sent() > Span::from_milliseconds(10)));
    if (outcome == ClockOutcome::kSlow) continue;
    RC_ASSERT(outcome == ClockOutcome::kUsed);
    in.push_back(e.answer);
    out.push_back({e.answer.device, e.answer.host, e.way_out_ns});
    const ClockState state = sync.state();
    while (in.back().device - in.front().device > state.window) in.erase(in.begin()), out.erase(out.begin());
    if (state.status != ClockStatus::kLocked) continue;
    const ErrorBounds upper = ErrorBounds::of(in), lower = ErrorBounds::of(out);
    const double error = error_ns(sync, e);
    RC_ASSERT(error >= (upper.least_ns - lower.most_ns) / 2 - 3);
    RC_ASSERT(error <= (upper.most_ns - lower.least_ns) / 2 + 3);
    RC_ASSERT(std::abs(error) <= static_cast<double>(state.bound.ns) + 0.5 * (upper.most_ns - lower.least_ns));
  }
  RC_ASSERT(sync.state().jumps + sync.state().outliers == 0u);
}

TEST(TwoWaySync, MeetsTheFiguresOfTheDocument) {
  std::mt19937 random(1);
  const TrueClock clock{987'654'321, -21e-6};
  TwoWaySync sync({});
  double worst_ns = 0;
  for (const Exchange& e : exchanges(clock, 0, 120 * kSecond, 1e6, random)) {
    sync.update(e.sent(), e.answer.device, e.received());
    if (e.answer.device.ns > 30 * kSecond) worst_ns = std::max(worst_ns, std::abs(error_ns(sync, e)));
  }
  std::printf("worst error from 30 s: %.1f us, skew %.2f ppm\n", worst_ns / 1e3, sync.state().skew_ppm);
  EXPECT_LT(worst_ns, 60e3);
  EXPECT_NEAR(sync.state().skew_ppm, -21, 2);
  EXPECT_NEAR(static_cast<double>(sync.state().bound.ns), 400e3, 60e3) << "half of the least round trip";
}

TEST(TwoWaySync, WaysOfUnequalLengthCostHalfTheirDifference) {
  const TrueClock clock{-77, 10e-6};
  TwoWaySync sync({});
  Exchange e;
  for (std::int64_t t = 0; t < 20 * kSecond; t += kSecond / 10) {
    e.answer.device = {t};
    e.answer.host = clock.host_of(e.answer.device);
    e.answer.delay_ns = 600'000;
    e.least_ns = 400'000;
    sync.update(e.sent(), e.answer.device, e.received());
  }
  EXPECT_NEAR(error_ns(sync, e), 300'000, 10);
}

RC_GTEST_PROP(TwoWaySync, AJumpIsFollowedAfterThreeExchanges, ()) {
  std::mt19937 random = any_random();
  const std::int64_t jump_ns =
      *rc::gen::element(-1, 1) * *rc::gen::inRange<std::int64_t>(15'000'000, 1'000'000'000'000);
  const TrueClock before = any_clock(), after{before.offset_ns - jump_ns, before.skew};
  TwoWaySync sync({});
  const std::int64_t at_ns = *rc::gen::inRange<std::int64_t>(1 * kSecond, 70 * kSecond);
  for (const Exchange& e : exchanges(before, 0, at_ns, 3e5, random))
    sync.update(e.sent(), e.answer.device, e.received());
  RC_ASSERT(sync.state().jumps == 0u);
  int used = 0;
  for (const Exchange& e : exchanges(after, at_ns + jump_ns, at_ns + jump_ns + 20 * kSecond, 3e5, random)) {
    const ClockOutcome outcome = sync.update(e.sent(), e.answer.device, e.received());
    if (outcome == ClockOutcome::kSlow) continue;
    ++used;
    if (used < 3) RC_ASSERT(outcome == ClockOutcome::kContradicts);
    if (used == 3) RC_ASSERT(outcome == ClockOutcome::kJumped);
    if (used > 100) RC_ASSERT(std::abs(error_ns(sync, e)) < 300e3);
  }
  RC_ASSERT(sync.state().jumps == 1u);
}

// Two in a row that contradict the model are no jump; each is counted once, when the next exchange dismisses it.
TEST(TwoWaySync, WhatContradictsTheModelIsCountedAsOutlier) {
  TwoWaySync sync({});
  std::int64_t device_ns = kSecond;
  const auto exchange = [&](std::int64_t offset_ms) {
    device_ns += kSecond / 10;
    const std::int64_t host_ns = device_ns + offset_ms * 1'000'000;
    return sync.update(HostStamp{host_ns - 500'000}, {device_ns}, HostStamp{host_ns + 500'000});
  };
  for (int i = 0; i < 20; ++i) ASSERT_EQ(exchange(0), ClockOutcome::kUsed);
  std::uint64_t outliers = 0;
  for (const std::vector<std::int64_t>& wrong :
       std::vector<std::vector<std::int64_t>>{{50}, {50, -50}, {50, 50}, {-50, 50, -50, 50}}) {
    for (const std::int64_t offset_ms : wrong) EXPECT_EQ(exchange(offset_ms), ClockOutcome::kContradicts);
    EXPECT_EQ(exchange(0), ClockOutcome::kUsed);
    EXPECT_EQ(sync.state().outliers, outliers += wrong.size());
  }
  EXPECT_EQ(sync.state().jumps, 0u);
  EXPECT_NEAR(static_cast<double>(sync.state().offset.ns), 0, 1'000);
}

RC_GTEST_PROP(TwoWaySync, SurvivesAnything, ()) {
  TwoWaySync sync({});
  std::mt19937_64 random(*rc::gen::arbitrary<unsigned>());
  const auto number = [&] { return static_cast<std::int64_t>(random()) >> (random() % 64); };
  for (int i = 0; i < 500; ++i) sync.update(HostStamp{number()}, {number()}, HostStamp{number()});
  const ClockState s = sync.state();
  RC_ASSERT(s.samples == 500u);
  RC_ASSERT(s.used + s.duplicates + s.disordered + s.slow + s.refused + s.outliers <= 500u);
}

TEST(TwoWaySync, RefusesAnAnswerBeforeItsQuestion) {
  TwoWaySync sync({});
  EXPECT_EQ(sync.update(HostStamp{10}, {5}, HostStamp{9}), ClockOutcome::kRefused);
  EXPECT_EQ(sync.state().status, ClockStatus::kEmpty);
}

}  // namespace
}  // namespace epiline
