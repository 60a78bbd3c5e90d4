#include "pipeline/watch/stamp_gate.h"
#include "tests/support/times.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace epiline {
namespace {

using Verdict = StampGate::Verdict;
constexpr Span kPeriod = Span::from_milliseconds(50);

/// A sensor of 20 Hz whose stamps are true, and whose driver is late by some jitter.
class Sensor {
 public:
  explicit Sensor(Span jitter = {}) : jitter_(jitter) {}
  HostStamp next_stamp() {
    stamp_ = stamp_ + kPeriod;
    const Span late{jitter_.ns > 0 ? static_cast<std::int64_t>(random_() % static_cast<std::uint64_t>(jitter_.ns)) : 0};
    arrival_ = std::max(arrival_, stamp_ + Span::from_milliseconds(8) + late);
    return stamp_;
  }
  HostStamp arrival() const { return arrival_; }

 private:
  Span jitter_;
  HostStamp stamp_{kStart_ns}, arrival_{kStart_ns};
  std::mt19937_64 random_{3};
};

TEST(StampGate, TrueStampsPassUnchangedHoweverLateTheyCome) {
  for (const Span jitter : {Span{}, Span::from_milliseconds(10), Span::from_milliseconds(400)}) {
    Sensor sensor(jitter);
    StampGate gate;
    for (int i = 0; i < 2000; ++i) {
      const HostStamp stamp = sensor.next_stamp();
      ASSERT_EQ(gate.step(stamp, sensor.arrival()), Verdict::kUse) << i;
      ASSERT_EQ(gate.corrected(), stamp);
      ASSERT_FALSE(gate.stepped());
    }
  }
}

class ClockStep : public testing::TestWithParam<int> {};

TEST_P(ClockStep, IsNamedAndTakenBackAndItsReturnToo) {
  const Span step = Span::from_milliseconds(GetParam());
  Sensor sensor(Span::from_milliseconds(5));
  StampGate gate;
  int suspects = 0, steps = 0;
  for (int i = 0; i < 300; ++i) {
    const HostStamp truth = sensor.next_stamp();
    const bool off = i >= 100 && i < 200;
    const Verdict verdict = gate.step(off ? truth + step : truth, sensor.arrival());
    if (verdict == Verdict::kSuspect) ++suspects;
    if (verdict != Verdict::kUse) continue;
    steps += gate.stepped() ? 1 : 0;
    ASSERT_NEAR((gate.corrected() - truth).seconds(), 0, 0.001) << i;
  }
  EXPECT_EQ(steps, 2);
  EXPECT_EQ(suspects, 2) << "one stamp each is left out";
  EXPECT_EQ(gate.correction(), Span{}) << "as if nothing had been";
}

INSTANTIATE_TEST_SUITE_P(StampGate, ClockStep, testing::Values(500, -500, 10'000, -10'000, 120, -120),
                         [](const auto& ms) {
                           return (ms.param < 0 ? "minus" : "plus") + std::to_string(std::abs(ms.param));
                         });

TEST(StampGate, OneWrongStampIsLeftOutAndNothingElse) {
  for (const int wrong_ms : {10'000, -10'000, 500, -500}) {
    Sensor sensor;
    StampGate gate;
    for (int i = 0; i < 100; ++i) {
      const HostStamp truth = sensor.next_stamp();
      const bool wrong = i == 50;
      const Verdict verdict = gate.step(wrong ? truth + Span::from_milliseconds(wrong_ms) : truth, sensor.arrival());
      ASSERT_EQ(verdict, wrong ? Verdict::kSuspect : Verdict::kUse) << i;
      ASSERT_EQ(gate.correction(), Span{});
    }
  }
}

TEST(StampGate, DoubledAndSwappedStampsAreLeftOutAndNoStep) {
  Sensor sensor;
  StampGate gate;
  HostStamp last;
  for (int i = 0; i < 100; ++i) {
    const HostStamp stamp = sensor.next_stamp();
    ASSERT_EQ(gate.step(stamp, sensor.arrival()), Verdict::kUse);
    if (i % 10 == 5) {
      ASSERT_EQ(gate.step(stamp, sensor.arrival()), Verdict::kOld);
    }
    if (i % 10 == 8) {
      ASSERT_NE(gate.step(last, sensor.arrival()), Verdict::kUse);
    }
    ASSERT_EQ(gate.correction(), Span{});
    last = stamp;
  }
}

TEST(StampGate, ASilenceIsNoStep) {
  Sensor sensor;
  StampGate gate;
  for (int i = 0; i < 300; ++i) {
    const HostStamp stamp = sensor.next_stamp();
    if (i > 100 && i < 250) continue;
    ASSERT_EQ(gate.step(stamp, sensor.arrival()), Verdict::kUse) << i;
    ASSERT_FALSE(gate.stepped());
  }
}

TEST(StampGate, WithoutArrivalsOnlyTheOrderCounts) {
  StampGate gate;
  EXPECT_EQ(gate.step({100}, {}), Verdict::kUse);
  EXPECT_EQ(gate.step({200}, {}), Verdict::kUse);
  EXPECT_EQ(gate.step({200}, {}), Verdict::kOld);
  EXPECT_EQ(gate.step({150}, {}), Verdict::kOld);
  EXPECT_EQ(gate.step({1'000'000'000}, {}), Verdict::kUse);
}

TEST(StampGate, ADriftingClockIsMeasuredThroughJitter) {
  for (const double drift : {200e-6, -200e-6, 0.0}) {
    StampGate gate;
    std::mt19937_64 random(5);
    for (int i = 0; i < 30 * 200; ++i) {
      const auto t_ns = static_cast<std::int64_t>(i) * 5'000'000;
      const HostStamp stamp{kStart_ns + t_ns + static_cast<std::int64_t>(drift * static_cast<double>(t_ns))};
      const HostStamp arrival{kStart_ns + t_ns + 1'000'000 + static_cast<std::int64_t>(random() % 2'000'000)};
      ASSERT_EQ(gate.step(stamp, arrival), Verdict::kUse) << i;
      ASSERT_FALSE(gate.stepped());
    }
    EXPECT_NEAR(gate.drift(), drift, 10e-6);
  }
}

}  // namespace
}  // namespace epiline
