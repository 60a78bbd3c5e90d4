#pragma once
// A stage between made-up inputs and outputs, without a thread: a test hands it something, calls step(), and looks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/stages/stage.h"
#include "pipeline/stages/stage_clocks.h"
#include "platform/concurrency/lock_count.h"
#include "platform/log/event.h"
#include "platform/memory/allocation_count.h"
#include "platform/ports/ports.h"
#include "tests/support/times.h"

namespace epiline::test {

/// A stamp so many ms after the start.
constexpr HostStamp at_ms(std::int64_t ms) { return HostStamp{kStart_ns + ms * kMs}; }

inline std::int64_t clock_ns = kStart_ns;  ///< of the stages; a test moves it
inline std::int64_t made_up_now() noexcept { return clock_ns; }
inline std::int64_t made_up_cpu() noexcept { return 0; }

using Lines = std::vector<std::string>;

/// What was told, as lines of events.txt with the time in ms since the start.
inline Lines told_by(EventRing& events) {
  Lines lines;
  for (Event event; events.pop(event);) {
    char text[128];
    const std::string line(text, format_event(event, text));
    lines.push_back(std::to_string((event.stamp.ns - kStart_ns) / kMs) + line.substr(line.find(' ')));
  }
  return lines;
}

class StageTest : public testing::Test {
 protected:
  StageTest() { clock_ns = kStart_ns; }

  /// Steps for as long as the stage does something, without heap or lock. A stage that did nothing must not say that it
  /// is ready: its thread would not sleep.
  static Step run(Stage& stage) {
    const HeapCallScope heap;
    const std::uint64_t locks = lock_calls_of_this_thread();
    Step step;
    int steps = 0;
    do {
      step = stage.step();
    } while (step.did == Step::Did::kWork && ++steps < 100'000);
    EXPECT_EQ(heap.calls(), 0);
    EXPECT_EQ(lock_calls_of_this_thread() - locks, 0u);
    EXPECT_NE(step.did, Step::Did::kWork) << "never rests";
    if (step.did == Step::Did::kNothing) {
      EXPECT_FALSE(stage.ready());
    }
    return step;
  }
  /// As run(), for a stage that must lack something.
  static std::int64_t sleeps_until_ms(Stage& stage) {
    const Step step = run(stage);
    EXPECT_EQ(step.did, Step::Did::kNothing);
    return (step.sleep_until_ns - kStart_ns) / kMs;
  }
  static void to_ms(std::int64_t ms) { clock_ns = kStart_ns + ms * kMs; }

  Lines told() { return told_by(*events); }

  Pace pace{HostStamp{kStart_ns}, kStart_ns, 1};
  FlightClock clock{{made_up_now, made_up_cpu}, &pace};
  std::unique_ptr<EventRing> events = std::make_unique<EventRing>();
};

inline ImuSample reading_at(std::int64_t ms) {
  ImuSample s;
  s.stamp = s.arrival = at_ms(ms);
  s.angular_velocity_rad_s = {0.001 * static_cast<double>(ms % 7), 0, 0};
  s.specific_force_m_s2 = {0, 0.01 * static_cast<double>(ms % 3), 9.81};
  return s;
}

/// Gives what a test has put in; without that, `otherwise`.
class MadeUpImu final : public ImuSource {
 public:
  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(std::span<ImuSample> samples, std::size_t& count, Span) noexcept override {
    for (count = 0; count < samples.size() && next < readings.size(); ++count) samples[count] = readings[next++];
    return count > 0 ? ReadOutcome::kSample : otherwise;
  }
  std::vector<ImuSample> readings;
  std::size_t next = 0;
  ReadOutcome otherwise = ReadOutcome::kTimeout;
};

/// Lends images out of a few buffers, and knows which of them are away.
class MadeUpCamera final : public CameraSource {
 public:
  static constexpr int kWidth = 160, kHeight = 120, kBuffers = 8;

  Status open() override { return Done{}; }
  void close() noexcept override {}
  ReadOutcome read(Frame& frame, Span) noexcept override {
    if (next == stamps_ms.size()) return otherwise;
    frame = image(stamps_ms[next]);
    ++next;
    return ReadOutcome::kSample;
  }
  void give_back(const Frame& frame) noexcept override {
    EXPECT_TRUE(std::exchange(away_[static_cast<std::size_t>(frame.slot)], false)) << "given back twice";
    ++returned;
  }

  /// The next image, out of a free buffer; dark ones show nothing.
  Frame image(std::int64_t ms, bool dark = false) {
    int slot = 0;
    while (slot + 1 < kBuffers && away_[static_cast<std::size_t>(slot)]) ++slot;
    EXPECT_FALSE(std::exchange(away_[static_cast<std::size_t>(slot)], true)) << "no buffer is left";
    auto& pixels = pixels_[static_cast<std::size_t>(slot)];
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const std::size_t block = i / kWidth / 8 * 31 + i % kWidth / 8;
      const std::uint64_t grey = block * 2654435761U % 200 + (i * 7 + sequence * 13) % 5;
      pixels[i] = static_cast<std::uint8_t>(dark ? 0 : grey);
    }
    Frame frame{at_ms(ms), sequence++, pixels.data(), kWidth, kHeight, kWidth, slot};
    if (dark) frame.reasons = bit(HealthReason::kLensCovered);
    return frame;
  }
  int away() const { return static_cast<int>(std::count(away_.begin(), away_.end(), true)); }

  std::vector<std::int64_t> stamps_ms;
  std::size_t next = 0;
  ReadOutcome otherwise = ReadOutcome::kTimeout;
  std::uint64_t sequence = 0;
  int returned = 0;

 private:
  std::array<bool, kBuffers> away_{};
  std::array<std::array<std::uint8_t, static_cast<std::size_t>(kWidth) * kHeight>, kBuffers> pixels_{};
};

}  // namespace epiline::test
