// Derivation: docs/derivations/spi_imu_clock.md
#include "drivers/sensors/imu/spi_imu_clock.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline {
namespace {

constexpr std::int64_t kPeriod_ns = 1'000'000;

/// One sample a millisecond; the chip's clock is right.
struct Stream {
  SampleClock clock{{Span{kPeriod_ns}, true}};
  static HostStamp taken(std::int64_t i) { return {7'000'000'000 + i * kPeriod_ns}; }
  static DeviceStamp device(std::int64_t i) { return {i * kPeriod_ns}; }
  /// A look that finds samples from..to, after their edges were added.
  bool look(std::int64_t from, std::int64_t to, Span after = Span{50'000}) {
    std::vector<DeviceStamp> devices;
    for (std::int64_t i = from; i <= to; ++i) devices.push_back(device(i));
    stamps.assign(devices.size(), HostStamp{});
    return clock.stamp(devices, taken(to) + after, stamps);
  }
  /// Looks at samples from..to one by one, each with its edge.
  void run(std::int64_t from, std::int64_t to) {
    for (std::int64_t i = from; i <= to; ++i) {
      clock.add_edge(taken(i));
      ASSERT_TRUE(look(i, i));
    }
  }
  std::vector<HostStamp> stamps;
};

TEST(SampleClock, AWrongFirstPairIsFound) {
  Stream s;
  // the edge of the sample before is still there, the sample's own was lost
  s.clock.add_edge(Stream::taken(0));
  ASSERT_TRUE(s.look(1, 1, Span{-200'000}));
  EXPECT_EQ(s.stamps[0], Stream::taken(0)) << "nobody can know yet";
  s.clock.add_edge(Stream::taken(1));
  int wrong = 0;
  for (std::int64_t i = 2; i < 200; ++i) {
    s.clock.add_edge(Stream::taken(i));
    if (s.look(i, i) && s.stamps[0] != Stream::taken(i)) ++wrong;
  }
  EXPECT_EQ(s.clock.counts().realigned, 1U);
  EXPECT_EQ(s.stamps[0], Stream::taken(199));
  EXPECT_LE(wrong, 64);
}

TEST(SampleClock, ASampleThatWasReadBeforeItsEdgeIsNoPair) {
  Stream s;
  s.run(0, 19);
  // the chip's counter jumped by two samples
  EXPECT_FALSE(s.look(22, 22, Span{-2 * kPeriod_ns}));
  EXPECT_EQ(s.clock.counts().realigned, 1U);
}

TEST(SampleClock, AnEdgeThatComesAfterItsSampleIsOld) {
  Stream s;
  s.run(0, 39);
  ASSERT_TRUE(s.look(40, 40));
  EXPECT_NEAR(static_cast<double>((s.stamps[0] - Stream::taken(40)).ns), 0, 1'000);
  EXPECT_TRUE(s.clock.is_old(Stream::taken(40)));
  EXPECT_FALSE(s.clock.is_old(Stream::taken(41)));
}

TEST(SampleClock, ALostEdgeBeforeTheModelIsGoodCostsItsSample) {
  Stream s;
  s.run(0, 4);
  EXPECT_FALSE(s.look(5, 5));
  s.clock.add_edge(Stream::taken(6));
  EXPECT_TRUE(s.look(6, 6));
  EXPECT_EQ(s.stamps[0], Stream::taken(6));
  EXPECT_EQ(s.clock.counts().by_model, 0U);
  EXPECT_EQ(s.clock.counts().unaligned, 1U);
}

TEST(SampleClock, ALineWithoutEdgesIsPolledAfterAWhile) {
  Stream s;
  std::int64_t first = 0;
  for (std::int64_t i = 0; i < 2'000 && first == 0; ++i)
    if (s.look(i, i)) first = i;
  EXPECT_NEAR(static_cast<double>(first), 1'500, 20);  // a second, and the half one that polling takes to learn
  EXPECT_LT((s.stamps[0] - Stream::taken(first)).ns, 60'000);
}

TEST(SampleClock, AStormOfEdgesIsBounded) {
  Stream s;
  for (std::int64_t i = 0; i < 100; ++i) {
    for (std::int64_t k = 0; k < 1'000; ++k) s.clock.add_edge(Stream::taken(i) + Span{k * 1'000});
    s.look(i, i, Span{kPeriod_ns});
  }
  EXPECT_GT(s.clock.counts().edges_unused, 90'000U);
}

// Without a line the model is all there is; after a reset the chip counts from zero.
TEST(SampleClock, ARestartForgetsTheModelOfPolledSamples) {
  SampleClock clock({Span{kPeriod_ns}, false});
  std::vector<HostStamp> stamps(1);
  const auto look = [&](std::int64_t i, std::int64_t counted) {
    const std::vector<DeviceStamp> devices{Stream::device(counted)};
    return clock.stamp(devices, Stream::taken(i) + Span{50'000}, stamps);
  };
  std::int64_t i = 0;
  while (i < 20'000 && !look(i, i)) ++i;
  ASSERT_LT(i, 20'000);
  EXPECT_EQ(stamps[0], Stream::taken(i) + Span{50'000});
  const std::int64_t settling = i;
  clock.restart();
  EXPECT_EQ(clock.state().status, ClockStatus::kEmpty);
  std::int64_t k = 0;
  while (k < 20'000 && !look(i + k, k)) ++k;
  EXPECT_EQ(k, settling) << "it is as unknown as at the beginning";
  EXPECT_EQ(stamps[0], Stream::taken(i + k) + Span{50'000});
  EXPECT_EQ(clock.state().jumps, 0U);
}

TEST(ChipCounter, CountsOnAcrossItsTurn) {
  ChipCounter<16> counter;
  EXPECT_EQ(counter.advance(65'000), 0);
  EXPECT_EQ(counter.advance(464), 1'000);
  EXPECT_EQ(counter.advance(463), 1'000 + 65'535);
  counter.restart();
  EXPECT_EQ(counter.step_to(3), 0U);
}

}  // namespace
}  // namespace epiline
