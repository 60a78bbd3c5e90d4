// GpioLine against the kernel's gpio-sim, with whichever libgpiod there is.
#include <array>
#include <chrono>
#include <cstdio>
#include <thread>

#include "drivers/sensors/gpio/gpio_line.h"
#include "platform/concurrency/lock_count.h"
#include "platform/memory/allocation_count.h"
#include "tests/hardware/gpio_support.h"

namespace epiline {
namespace {

constexpr Span kWait = Span::from_milliseconds(20'000), kShort = Span::from_milliseconds(200);

/// Interrupts of gpio-sim are handled a little later; one that comes before is lost.
void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(20)); }

TEST(GpioLineOfTheKernel, StampsEdgesOfOneKindWithMonotonicTime) {
  const SimulatedGpio gpio("trigger-board", {"", "cam-trigger", "other"});
  for (const auto& [name, edge] :
       {std::pair{"cam-trigger", Edge::kRising}, std::pair{"trigger-board:1", Edge::kFalling},
        std::pair{gpio.chip().c_str(), Edge::kRising}}) {
    GpioLine line(name == gpio.chip() ? gpio.chip() + ":1" : name, edge);
    ASSERT_OPENS(line);
    std::array<HostStamp, 8> stamps;
    std::size_t count = 7;
    EXPECT_EQ(line.read(stamps, count, Span{0}), ReadOutcome::kTimeout);
    EXPECT_EQ(count, 0u);
    for (int i = 0; i < 5; ++i) {
      const auto rising = gpio.edge(1, true);
      gpio.set(2, i % 2 == 0);
      pause();
      const auto falling = gpio.edge(1, false);
      pause();
      ASSERT_EQ(line.read(stamps, count, kWait), ReadOutcome::kSample) << name;
      ASSERT_EQ(count, 1u);
      const auto& expected = edge == Edge::kRising ? rising : falling;
      EXPECT_GE(stamps[0].ns, expected.begin_ns);
      // the handler may run after the write has returned
      EXPECT_LT(stamps[0].ns, edge == Edge::kRising ? falling.begin_ns : expected.end_ns + 20'000'000);
    }
    EXPECT_EQ(line.read(stamps, count, Span{0}), ReadOutcome::kTimeout) << "nothing else";
    EXPECT_EQ(line.counts().edges, 5u);
    EXPECT_EQ(line.counts().lost, 0u);
  }
}

TEST(GpioLineOfTheKernel, WaitsNoLongerThanAskedAndWakesForAnEdge) {
  const SimulatedGpio gpio("waiting", {"line"});
  GpioLine line("line", Edge::kRising);
  ASSERT_OPENS(line);
  std::array<HostStamp, 8> stamps;
  std::size_t count = 0;
  std::int64_t begin_ns = monotonic_ns();
  EXPECT_EQ(line.read(stamps, count, kShort), ReadOutcome::kTimeout);
  EXPECT_GE(monotonic_ns() - begin_ns, kShort.ns);
  std::thread hand([&] {
    pause();
    gpio.set(0, true);
  });
  EXPECT_EQ(line.read(stamps, count, kWait), ReadOutcome::kSample);
  hand.join();
}

TEST(GpioLineOfTheKernel, ReadingUsesNoHeapAndNoLocks) {
  const SimulatedGpio gpio("frugal", {"line"});
  GpioLine line("line", Edge::kRising);
  ASSERT_OPENS(line);
  std::array<HostStamp, 8> stamps;
  std::size_t count = 0;
  for (int i = 0; i < 5; ++i) {
    gpio.set(0, true);
    pause();
    gpio.set(0, false);
    pause();
  }
  ASSERT_TRUE(allocation_counting_available());
  const HeapCallScope heap;
  const std::uint64_t locks = lock_calls_of_this_thread();
  ASSERT_EQ(line.read(std::span(stamps).first(2), count, kWait), ReadOutcome::kSample);
  EXPECT_EQ(count, 2u);
  const HostStamp before = stamps[1];
  ASSERT_EQ(line.read(stamps, count, kWait), ReadOutcome::kSample);
  EXPECT_EQ(count, 3u);
  EXPECT_GT(stamps[0], before);
  EXPECT_GT(stamps[2], stamps[1]);
  EXPECT_EQ(line.read(stamps, count, Span{0}), ReadOutcome::kTimeout);
  EXPECT_EQ(heap.calls(), 0u);
  EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
}

TEST(GpioLineOfTheKernel, SaysWhichLinesThereAreAndWhoUsesOne) {
  const SimulatedGpio gpio("board", {"strobe", "", "pps"});
  GpioLine missing("flash", Edge::kRising);
  EXPECT_EQ(missing.open().error().text(),
            "GPIO line flash: no line has this name; expected one of strobe, pps; or CHIP:OFFSET with one of the "
            "chips board (" +
                gpio.chip() + ", 0 to 2)");
  GpioLine first("strobe", Edge::kRising), second("board:0", Edge::kFalling);
  ASSERT_OPENS(first);
  EXPECT_EQ(second.open().error().text(),
            "GPIO line board:0: in use by 'epiline'; expected a line that no other program uses");
  first.close();
  ASSERT_OPENS(second);
}

TEST(GpioLineOfTheKernel, ARemovedChipIsAFailure) {
  SimulatedGpio gpio("brief", {"line"});
  GpioLine line("line", Edge::kRising);
  ASSERT_OPENS(line);
  std::thread hand([&] {
    pause();
    gpio.unplug();
  });
  std::array<HostStamp, 8> stamps;
  std::size_t count = 0;
  const std::int64_t begin_ns = monotonic_ns();
  ReadOutcome outcome = ReadOutcome::kTimeout;
  while (outcome == ReadOutcome::kTimeout && monotonic_ns() - begin_ns < kWait.ns)
    outcome = line.read(stamps, count, kShort);
  hand.join();
  EXPECT_EQ(outcome, ReadOutcome::kFailed);
  EXPECT_EQ(line.counts().last_error, ENODEV);
  EXPECT_FALSE(line.open());
}

// An adapter that is unplugged and plugged in again. Whoever reads it makes no heap call meanwhile.
TEST(GpioLineOfTheKernel, AChipThatComesBackIsReadAgain) {
  SimulatedGpio gpio("returning", {"line"});
  GpioLine line("line", Edge::kRising);
  ASSERT_OPENS(line);
  std::array<HostStamp, 8> stamps;
  std::size_t count = 0;
  const auto read_until = [&](ReadOutcome wanted) {
    for (const std::int64_t until_ns = monotonic_ns() + kWait.ns; monotonic_ns() < until_ns;) {
      const HeapCallScope heap;
      const ReadOutcome outcome = line.read(stamps, count, kShort);
      EXPECT_EQ(heap.calls(), 0u);
      if (outcome == wanted) return true;
      if (outcome == ReadOutcome::kFailed) pause();
    }
    return false;
  };
  for (std::uint64_t times = 1; times <= 2; ++times) {
    gpio.unplug();
    ASSERT_TRUE(read_until(ReadOutcome::kFailed));
    EXPECT_EQ(line.counts().disconnected, times);
    EXPECT_EQ(line.counts().last_error, ENODEV);
    pause();
    gpio.plug_in();
    ASSERT_TRUE(read_until(ReadOutcome::kTimeout)) << "well again";
    EXPECT_EQ(line.counts().last_error, 0);
    const auto between = gpio.edge(0, true);
    ASSERT_TRUE(read_until(ReadOutcome::kSample));
    EXPECT_GE(stamps[0].ns, between.begin_ns);
  }
  gpio.unplug();
  ASSERT_TRUE(read_until(ReadOutcome::kFailed));
  line.close();  // while it is looked for
  EXPECT_FALSE(line.is_open());
}

// With libgpiod 1 the kernel keeps 16 events and does not say what it left out.
TEST(GpioLineOfTheKernel, WhatTheKernelHadNoRoomForIsCountedIfItSays) {
  const SimulatedGpio gpio("flood", {"line"});
  GpioLine line("line", Edge::kRising);
  ASSERT_OPENS(line);
  constexpr std::uint64_t kPulses = 400;
  for (std::uint64_t i = 0; i < kPulses; ++i) {
    gpio.set(0, true);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    gpio.set(0, false);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::array<HostStamp, 64> stamps;
  std::size_t count = 0;
  while (line.read(stamps, count, kShort) == ReadOutcome::kSample) {
  }
  const GpioCounts counts = line.counts();
  std::printf("%llu edges read, %llu lost\n", static_cast<unsigned long long>(counts.edges),
              static_cast<unsigned long long>(counts.lost));
  EXPECT_LT(counts.edges, kPulses);
  if (counts.lost > 0) {
    EXPECT_LE(counts.edges + counts.lost, kPulses);
    EXPECT_GT(counts.edges + counts.lost, kPulses * 9 / 10) << "an emulator may lose some interrupts";
  }
}

}  // namespace
}  // namespace epiline
