// Derivation: docs/derivations/clock_sync.md
#include "platform/time/one_way_sync.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "platform/memory/allocation_count.h"
#include "tests/platform/time/clock_fixture.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

double error_ns(const OneWaySync& sync, const Arrival& a) {
  return static_cast<double>((sync.translate(a.device) - a.host).ns);
}

/// The samples of the window that the model says it uses.
std::vector<Arrival> in_window(const std::vector<Arrival>& samples, std::size_t newest, const ClockState& state) {
  std::vector<Arrival> used;
  for (std::size_t i = 0; i <= newest; ++i)
    if (samples[newest].device - samples[i].device <= state.window) used.push_back(samples[i]);
  return used;
}

std::uint64_t counted(const ClockState& s) {
  return s.used + s.duplicates + s.disordered + s.slow + s.late + s.refused + s.outliers;
}

// The theorem on the error, for any clock and any delays.
RC_GTEST_PROP(OneWaySync, ErrsNoMoreThanTheDelaysAllow, ()) {
  const TrueClock clock = any_clock();
  std::mt19937 random = any_random();
  Traffic traffic;
  traffic.rate_hz = *rc::gen::inRange(10, 400);
  traffic.delay_mean_ns = *rc::gen::inRange(1'000, 3'000'000);
  OneWaySettings settings;
  settings.min_delay = Span{*rc::gen::inRange(0, 5'000'000)};
  OneWaySync sync(settings);
  const auto samples = traffic.make(clock, 0, 75 * kSecond, random);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ClockOutcome outcome = sync.update(samples[i].device, samples[i].arrival() + settings.min_delay);
    RC_ASSERT(outcome == ClockOutcome::kUsed || outcome == ClockOutcome::kLate);
    RC_ASSERT(sync.translate(samples[i].device) <= samples[i].arrival() + Span{1});
    if (i % (samples.size() / 12) != 0 || sync.state().status != ClockStatus::kLocked) continue;
    // those counted late have no part in the model, and would only widen the bounds
    auto window = in_window(samples, i, sync.state());
    window.erase(std::remove_if(window.begin(), window.end(), [&](const Arrival& a) { return a.delay_ns > 9'000'000; }),
                 window.end());
    window.push_back(samples[i]);
    RC_ASSERT(std::abs(error_ns(sync, samples[i])) < 1e6);
    if (samples[i].delay_ns > 9'000'000 || samples.size() < 3000) continue;
    RC_ASSERT(ErrorBounds::of(window).hold(error_ns(sync, samples[i])));
  }
  const ClockState state = sync.state();
  RC_ASSERT(state.jumps == 0u);
  RC_ASSERT(counted(state) == samples.size());
}

// What that means for an IMU at 200 Hz whose serial line jitters.
TEST(OneWaySync, MeetsTheFiguresOfTheDocument) {
  std::mt19937 random(1);
  const TrueClock clock{-123'456'789'000, 37e-6};
  OneWaySync sync({});
  Traffic traffic;  // 0.3 ms mean delay, stalls
  double worst_settling_ns = 0, worst_locked_ns = 0, worst_full_ns = 0;
  for (const Arrival& a : traffic.make(clock, 0, 120 * kSecond, random)) {
    sync.update(a.device, a.arrival());
    const double error = std::abs(error_ns(sync, a));
    if (a.device.ns < 5 * kSecond) {
      if (a.device.ns > kSecond) worst_settling_ns = std::max(worst_settling_ns, error);
    } else {
      worst_locked_ns = std::max(worst_locked_ns, error);
      if (a.device.ns > 30 * kSecond) worst_full_ns = std::max(worst_full_ns, error);
    }
  }
  std::printf("worst error: 1 to 5 s %.1f us, 5 to 30 s and later %.1f us, from 30 s %.1f us\n",
              worst_settling_ns / 1e3, worst_locked_ns / 1e3, worst_full_ns / 1e3);
  EXPECT_LT(worst_settling_ns, 100e3);
  EXPECT_LT(worst_locked_ns, 20e3);
  EXPECT_LT(worst_full_ns, 5e3);
  EXPECT_EQ(sync.state().status, ClockStatus::kLocked);
  EXPECT_NEAR(sync.state().skew_ppm, 37, 0.5);
  EXPECT_NEAR(static_cast<double>(sync.state().offset.ns), -123'456'789'000 + 37e-6 * 120e9, 5e3);
}

RC_GTEST_PROP(OneWaySync, ADeviceThatStartsAnewIsFollowedWithinASecond, ()) {
  std::mt19937 random = any_random();
  Traffic traffic;
  traffic.stalls_per_s = 0;
  const TrueClock before = any_clock(),
                  after{before.offset_ns + *rc::gen::inRange<std::int64_t>(30'000'000, 1'000'000'000'000), before.skew};
  const std::int64_t reset_ns = *rc::gen::inRange<std::int64_t>(2 * kSecond, 70 * kSecond);
  // the new clock shows less at the same host time
  const std::int64_t set_back_ns = after.offset_ns - before.offset_ns;
  OneWaySync sync({});
  for (const Arrival& a : traffic.make(before, 0, reset_ns, random)) sync.update(a.device, a.arrival());
  RC_ASSERT(sync.state().jumps == 0u);
  const auto later = traffic.make(after, reset_ns - set_back_ns, reset_ns - set_back_ns + 20 * kSecond, random);
  std::int64_t followed_after_ns = -1;
  for (const Arrival& a : later) {
    const ClockOutcome outcome = sync.update(a.device, a.arrival());
    if (outcome == ClockOutcome::kJumped) followed_after_ns = (a.device - later[0].device).ns;
    if (followed_after_ns >= 0) RC_ASSERT(std::abs(error_ns(sync, a)) < 500e3);
  }
  RC_ASSERT(followed_after_ns >= 0);
  RC_ASSERT(followed_after_ns < kSecond * 11 / 10);
  RC_ASSERT(sync.state().jumps == 1u);
  RC_ASSERT(std::abs(error_ns(sync, later.back())) < 50e3);
}

TEST(OneWaySync, AStallOfSecondsIsNoJump) {
  const TrueClock clock{1'000'000, 10e-6};
  OneWaySync sync({});
  for (std::int64_t t = 0; t < 20 * kSecond; t += 5'000'000) {
    const HostStamp host = clock.host_of({t});
    // everything of 10 s to 12.5 s comes at its end, at once
    const bool stalled = t >= 10 * kSecond && t < 12'500'000'000;
    sync.update({t}, stalled ? clock.host_of({12'500'000'000}) : host);
    if (t > 6 * kSecond) {
      EXPECT_LT(std::abs((sync.translate({t}) - host).ns), 10);
    }
  }
  EXPECT_EQ(sync.state().jumps, 0u);
  EXPECT_EQ(sync.state().late, 499u) << "all but the last";
}

RC_GTEST_PROP(OneWaySync, AClockThatLeapsAheadIsFollowedAfterThreeSamples, ()) {
  std::mt19937 random = any_random();
  Traffic traffic;
  traffic.stalls_per_s = 0;
  const std::int64_t leap_ns = *rc::gen::inRange<std::int64_t>(10'000'000, 1'000'000'000'000);
  const TrueClock before = any_clock(180), after{before.offset_ns - leap_ns, before.skew};
  OneWaySync sync({});
  for (const Arrival& a : traffic.make(before, 0, 40 * kSecond, random)) sync.update(a.device, a.arrival());
  const auto later = traffic.make(after, 40 * kSecond + leap_ns, 60 * kSecond + leap_ns, random);
  for (std::size_t i = 0; i < later.size(); ++i) {
    const ClockOutcome outcome = sync.update(later[i].device, later[i].arrival());
    if (i < 2) RC_ASSERT(outcome == ClockOutcome::kContradicts);
    if (i == 2) RC_ASSERT(outcome == ClockOutcome::kJumped);
  }
  RC_ASSERT(sync.state().jumps == 1u);
  RC_ASSERT(sync.state().outliers == 0u);
  RC_ASSERT(std::abs(error_ns(sync, later.back())) < 50e3);
}

RC_GTEST_PROP(OneWaySync, GarbledStampsDoNotMoveIt, ()) {
  std::mt19937 random = any_random();
  const TrueClock clock = any_clock(180);
  OneWaySync sync({}), undisturbed({});
  std::uniform_real_distribution<double> uniform(0, 1);
  int garbled = 0;
  for (const Arrival& a : Traffic{}.make(clock, 0, 40 * kSecond, random)) {
    // (a stamp ahead by as much as its sample is delayed cannot be told from a good one)
    if (a.device.ns > 10 * kSecond && a.delay_ns < 5'000'000 && uniform(random) < 0.05) {
      const std::int64_t bit = std::int64_t{1} << (24 + static_cast<int>(uniform(random) * 39));  // 17 ms and more
      sync.update({a.device.ns ^ bit}, a.arrival());
      ++garbled;
    }
    sync.update(a.device, a.arrival());
    undisturbed.update(a.device, a.arrival());
    RC_ASSERT(sync.translate(a.device) == undisturbed.translate(a.device));
  }
  const ClockState state = sync.state();
  RC_ASSERT(state.jumps == 0u);
  RC_ASSERT(state.outliers > 0u);
  RC_ASSERT(state.outliers + state.late + state.refused >= static_cast<std::uint64_t>(garbled));
}

TEST(OneWaySync, AGarbledFirstStampIsOvercome) {
  for (const std::int64_t garbage : {std::int64_t{-1} << 59, -kSecond, kSecond, std::int64_t{1} << 60}) {
    std::mt19937 random(2);
    const TrueClock clock{5'000, 20e-6};
    OneWaySync sync({});
    sync.update({garbage}, HostStamp{5'000});
    const auto samples = Traffic{}.make(clock, 0, 3 * kSecond, random);
    for (const Arrival& a : samples) sync.update(a.device, a.arrival());
    EXPECT_LT(std::abs(error_ns(sync, samples.back())), 200e3) << garbage;
  }
}

RC_GTEST_PROP(OneWaySync, DuplicatesAndDisorderChangeNothing, ()) {
  std::mt19937 random = any_random();
  const TrueClock clock = any_clock();
  OneWaySync sync({}), in_order({});
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto samples = Traffic{}.make(clock, 0, 12 * kSecond, random);
  std::uint64_t twice = 0, late_ones = 0;
  for (std::size_t i = 10; i < samples.size(); ++i) {
    sync.update(samples[i].device, samples[i].arrival());
    in_order.update(samples[i].device, samples[i].arrival());
    const double kind = uniform(random);
    const bool is_on_time = samples[i].delay_ns < 9'000'000;
    if (kind < 0.1 && is_on_time) {
      RC_ASSERT(sync.update(samples[i].device, samples[i].arrival()) == ClockOutcome::kDuplicate);
      ++twice;
    } else if (kind < 0.2 && is_on_time && samples[i - 1].delay_ns < 9'000'000) {
      RC_ASSERT(sync.update(samples[i - 1].device, samples[i - 1].arrival()) == ClockOutcome::kDisordered);
      ++late_ones;
    }
    RC_ASSERT(sync.translate(samples[i].device) == in_order.translate(samples[i].device));
  }
  RC_ASSERT(sync.state().duplicates == twice);
  RC_ASSERT(sync.state().disordered == late_ones);
}

RC_GTEST_PROP(OneWaySync, RefusesAClockThatIsNoCrystal, ()) {
  std::mt19937 random = any_random();
  const double sign = *rc::gen::element(-1.0, 1.0);
  const TrueClock wrong{0, sign * *rc::gen::inRange(220, 100'000) * 1e-6};
  const TrueClock right{0, sign * *rc::gen::inRange(0, 180) * 1e-6};
  OneWaySync refused({}), locked({});
  Traffic traffic;
  traffic.rate_hz = 50;
  for (const Arrival& a : traffic.make(wrong, 0, 60 * kSecond, random)) refused.update(a.device, a.arrival());
  for (const Arrival& a : traffic.make(right, 0, 60 * kSecond, random)) {
    locked.update(a.device, a.arrival());
    RC_ASSERT(locked.state().status != ClockStatus::kUnusable);
  }
  RC_ASSERT(refused.state().status == ClockStatus::kUnusable);
  RC_ASSERT(locked.state().status == ClockStatus::kLocked);
}

// Whatever comes over a wire: no overflow (the sanitizers look on), no sample uncounted.
RC_GTEST_PROP(OneWaySync, SurvivesAnything, ()) {
  OneWaySync sync({});
  std::uint64_t jumped = 0, samples = 0;
  const auto anything = *rc::gen::container<std::vector<std::pair<std::int64_t, std::int64_t>>>(
      rc::gen::pair(rc::gen::arbitrary<std::int64_t>(), rc::gen::arbitrary<std::int64_t>()));
  std::mt19937_64 random(*rc::gen::arbitrary<unsigned>());
  for (const auto& [device, arrival] : anything) {
    sync.update({device}, HostStamp{arrival});
    sync.update({static_cast<std::int64_t>(random())}, HostStamp{static_cast<std::int64_t>(random())});
    jumped += sync.update({static_cast<std::int64_t>(random() >> 3)}, HostStamp{arrival >> 3}) == ClockOutcome::kJumped;
    samples += 3;
  }
  RC_ASSERT(sync.state().samples == samples);
  RC_ASSERT(counted(sync.state()) <= samples);
}

TEST(OneWaySync, UsesNoHeap) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted here";
  std::mt19937 random(3);
  const auto samples = Traffic{}.make({1, 1e-5}, 0, 70 * kSecond, random);
  const HeapCallScope scope;
  OneWaySync sync({});
  for (const Arrival& a : samples) sync.update(a.device, a.arrival());
  EXPECT_EQ(scope.calls(), 0u);
}

// What `check` and the flight record say of a clock.
TEST(OneWaySync, StatesHowFarItsSamplesLieFromTheLine) {
  OneWaySync sync(OneWaySettings{});
  for (std::int64_t i = 0; i <= 2'000; ++i) {
    const std::int64_t delay_ns = i % 2 == 0 ? 0 : i == 1'001 ? 4'000'000 : 1'000'000;
    const std::int64_t device_ns = kSecond + i * 10 * kMs;
    sync.update(DeviceStamp{device_ns}, HostStamp{device_ns + 50 * kSecond + delay_ns});
  }
  const ClockState state = sync.state();
  EXPECT_NEAR(static_cast<double>(state.offset.ns), 50e9, 1e3);
  // half of them by 1 ms, one by 4 ms
  EXPECT_NEAR(static_cast<double>(state.residual_rms.ns), std::sqrt((1'000 + 15) / 2'001.0) * 1e6, 5e3);
  EXPECT_NEAR(static_cast<double>(state.residual_most.ns), 4e6, 1e4);
}

}  // namespace
}  // namespace epiline
