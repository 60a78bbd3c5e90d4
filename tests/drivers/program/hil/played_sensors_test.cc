#include "drivers/program/hil/played_sensors.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline::hil {
namespace {

constexpr HostStamp kRecorded{1'403'636'580'000'000'000};  // years ago
constexpr Span kInterval = Span::from_milliseconds(2);

AslDataset readings(int count) {
  AslDataset dataset;
  for (int i = 0; i < count; ++i) {
    ImuSample s;
    s.stamp = {kRecorded.ns + i * kInterval.ns};
    s.angular_velocity_rad_s = {0.001 * i, 0, 0};
    dataset.imu_samples.push_back(s);
  }
  return dataset;
}

/// All readings of a played flight.
std::vector<ImuSample> play(const AslDataset& dataset, const Disturbance& disturbance, std::int64_t begin_ns) {
  const FlightPlan plan;
  PlayClock clock;
  PlayedImu imu(dataset, plan, clock, disturbance);
  std::array<ImuSample, 16> chunk;
  std::size_t count = 0;
  EXPECT_EQ(imu.read(chunk, count, Span::from_milliseconds(5)), ReadOutcome::kTimeout) << "not started";
  clock.start(kRecorded, begin_ns);
  std::vector<ImuSample> all;
  while (true) {
    const ReadOutcome outcome = imu.read(chunk, count, Span::from_milliseconds(20));
    if (outcome == ReadOutcome::kEnd) return all;
    all.insert(all.end(), chunk.begin(), chunk.begin() + static_cast<std::ptrdiff_t>(count));
  }
}

TEST(PlayedImu, ReadingsComeAtTheirTimesOnThisComputersClock) {
  const AslDataset dataset = readings(50);
  const std::int64_t begin_ns = monotonic_ns() + 5'000'000;
  const auto played = play(dataset, {}, begin_ns);
  ASSERT_EQ(played.size(), 50u);
  for (int i = 0; i < 50; ++i) {
    const ImuSample& s = played[static_cast<std::size_t>(i)];
    EXPECT_EQ(s.stamp.ns, begin_ns + i * kInterval.ns);
    EXPECT_GE(s.arrival, s.stamp);
    EXPECT_EQ(s.angular_velocity_rad_s[0], 0.001 * i);
  }
}

TEST(PlayedImu, ItsClockRunsFasterOnDemand) {
  const std::int64_t begin_ns = monotonic_ns();
  const auto played = play(readings(50), {.skew_ppm = 10'000}, begin_ns);
  ASSERT_EQ(played.size(), 50u);
  EXPECT_EQ(played.back().stamp.ns, begin_ns + 49 * kInterval.ns * 101 / 100);
}

TEST(PlayedImu, LosesTheShareAskedFor) {
  const auto played = play(readings(200), {.loss = 0.25}, monotonic_ns());
  EXPECT_NEAR(static_cast<double>(played.size()), 150, 25);  // 4 standard deviations
  for (std::size_t i = 1; i < played.size(); ++i) EXPECT_GT(played[i].stamp, played[i - 1].stamp);
}

TEST(Delivery, JitterDelaysAndKeepsTheOrder) {
  Delivery delivery({.jitter_ms = 10}, 1);
  std::int64_t before_ns = 0, most_ns = 0;
  for (std::int64_t due_ns = 0; due_ns < 1'000'000'000; due_ns += 1'000'000) {
    const std::int64_t ns = delivery.instant_ns(due_ns, 0);
    EXPECT_GE(ns, due_ns);
    EXPECT_LT(ns, due_ns + 10'000'000);
    EXPECT_GE(ns, before_ns);
    most_ns = std::max(most_ns, ns - due_ns);
    before_ns = ns;
  }
  EXPECT_GT(most_ns, 9'000'000);
}

TEST(Delivery, BurstsHoldBackForEightyMilliseconds) {
  Delivery delivery({.bursts = true}, 1);
  const std::int64_t begin_ns = 7'000'000;
  for (int ms = 0; ms < 2'500; ++ms) {
    const int phase_ms = ms % 1'000, expected_ms = phase_ms < 80 ? ms - phase_ms + 80 : ms;
    EXPECT_EQ(delivery.instant_ns(begin_ns + ms * 1'000'000LL, begin_ns), begin_ns + expected_ms * 1'000'000LL);
  }
}

}  // namespace
}  // namespace epiline::hil
