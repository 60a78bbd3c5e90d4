// The speed of wheels on a vcan of the kernel.
#include <cstdint>
#include <thread>
#include <vector>

#include "drivers/sensors/wheel/can_wheel_source.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/can_support.h"

namespace epiline {
namespace {

// Between the readings of two clocks an emulated processor may lose some milliseconds; waiting takes 30, an hour is
// set.
constexpr std::int64_t kReadApart_ns = 15'000'000;

WheelConfig wheel_config() {
  WheelConfig config;
  config.interface = kBus;
  config.signal = {.id = 0x1a0, .start_bit = 16, .length = 16, .is_signed = true, .scale = 0.01};
  return config;
}
std::vector<std::uint8_t> speed_frame(int centimetres) {
  return {0, 0, static_cast<std::uint8_t>(centimetres & 0xff), static_cast<std::uint8_t>(centimetres >> 8 & 0xff),
          0, 0};
}

TEST_F(CanBus, SpeedComesInWithTheTimeOfItsArrival) {
  CanWheelSource source(wheel_config());
  ASSERT_OPENS(source);
  Peer peer(false);
  const HeapCallScope heap;
  WheelSample sample;
  EXPECT_EQ(source.read(sample, Span::from_milliseconds(50)), ReadOutcome::kTimeout);
  const std::uint64_t calls_before = heap.calls();
  std::uint64_t calls = 0;
  for (int i = -20; i < 20; ++i) {
    const std::int64_t before_ns = monotonic_ns();
    ASSERT_TRUE(peer.say(0x1a0, speed_frame(37 * i)));
    const std::int64_t after_ns = monotonic_ns();
    std::this_thread::sleep_for(std::chrono::milliseconds(30));  // it waits; its stamp does not
    const HeapCallScope reading;
    ASSERT_EQ(source.read(sample, Span::from_milliseconds(10'000)), ReadOutcome::kSample);
    calls += reading.calls();
    EXPECT_NEAR(sample.forward_speed_m_s, 0.37 * i, 1e-9);
    EXPECT_GE(sample.stamp.ns, before_ns - kReadApart_ns);
    EXPECT_LE(sample.stamp.ns, after_ns + kReadApart_ns);
  }
  EXPECT_EQ(calls + calls_before, 0u);
  EXPECT_EQ(source.counts().samples, 40u);
  EXPECT_EQ(source.counts().bad_stamps, 0u);
}

TEST_F(CanBus, TheClockOfDayIsSetWhileSpeedComesIn) {
  CanWheelSource source(wheel_config());
  ASSERT_OPENS(source);
  Peer peer(false);
  WheelSample sample;
  // The first socket that asks for them gets stamps a while later (net_enable_timestamp()); until then a frame has the
  // time of its reading.
  ASSERT_TRUE(within(20, [&] {
    const bool said = peer.say(0x1a0, speed_frame(0));
    const std::int64_t after_ns = monotonic_ns();
    std::this_thread::sleep_for(std::chrono::nanoseconds(2 * kReadApart_ns));
    return said && source.read(sample, Span::from_milliseconds(10'000)) == ReadOutcome::kSample &&
           sample.stamp.ns <= after_ns + kReadApart_ns;
  }));
  for (int i = 0; i < 9; ++i) {
    const std::int64_t before_ns = monotonic_ns();
    ASSERT_TRUE(peer.say(0x1a0, speed_frame(i)));
    const std::int64_t after_ns = monotonic_ns();
    if (i == 4) {
      ASSERT_TRUE(shell("date -s '+1 hour'"));
    }
    ASSERT_EQ(source.read(sample, Span::from_milliseconds(10'000)), ReadOutcome::kSample);
    EXPECT_GE(sample.stamp.ns, before_ns - kReadApart_ns) << i;
    EXPECT_LE(sample.stamp.ns, after_ns + kReadApart_ns) << i;
  }
  shell("date -s '-1 hour'");
}

TEST_F(CanBus, SpeedSurvivesWhateverElseIsOnTheBus) {
  CanWheelSource source(wheel_config());
  ASSERT_OPENS(source);
  Peer peer(false);
  Flood flood(0x1a0);
  WheelSample sample;
  for (int i = 0; i < 100; ++i) {
    if (i % 4 == 0) {
      ASSERT_TRUE(peer.say(0x1a0, {1, 2, 3}));  // too short
    }
    ASSERT_TRUE(peer.say(0x1a0, speed_frame(i)));
    ASSERT_EQ(source.read(sample, Span::from_milliseconds(20'000)), ReadOutcome::kSample);
    EXPECT_NEAR(sample.forward_speed_m_s, 0.01 * i, 1e-9);
  }
  EXPECT_TRUE(within(60, [&] { return flood.frames() > 10'000; }));
  EXPECT_EQ(source.counts().too_short, 25u);
  EXPECT_EQ(source.counts().samples, 100u);
  EXPECT_EQ(source.counts().overruns, 0u);
}

TEST_F(CanBus, SpeedComesBackWithTheInterface) {
  CanWheelSource source(wheel_config());
  ASSERT_OPENS(source);
  WheelSample sample;
  const auto reads = [&](ReadOutcome wanted) {
    return within(20, [&] { return source.read(sample, Span::from_milliseconds(100)) == wanted; });
  };
  ASSERT_TRUE(set_bus("down"));
  EXPECT_TRUE(reads(ReadOutcome::kFailed));
  ASSERT_TRUE(set_bus("up"));
  EXPECT_TRUE(reads(ReadOutcome::kTimeout));
  remove_bus();
  EXPECT_TRUE(reads(ReadOutcome::kFailed));
  ASSERT_TRUE(make_bus());
  EXPECT_TRUE(reads(ReadOutcome::kTimeout));
  Peer peer(false);
  ASSERT_TRUE(peer.say(0x1a0, speed_frame(123)));
  EXPECT_TRUE(reads(ReadOutcome::kSample));
  EXPECT_NEAR(sample.forward_speed_m_s, 1.23, 1e-9);
  EXPECT_EQ(source.counts().disconnected, 2u);
}

}  // namespace
}  // namespace epiline
