// What needs no bus. The rest is in tests/hardware/can_test.cc, against the kernel's vcan.
#include "drivers/sensors/wheel/can_wheel_source.h"

#include <gtest/gtest.h>
#include <linux/can.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "platform/time/monotonic.h"
#include "tests/support/times.h"

namespace epiline {
namespace {

std::string error_of(const WheelConfig& config) {
  CanWheelSource source(config);
  const Status status = source.open();
  return status ? "opened" : status.error().text();
}

TEST(CanWheelSource, SaysWhatIsWrongWithTheSettings) {
  EXPECT_EQ(error_of({}), "[wheel]: interface is not set; expected wheel.interface, as `ip -br link` shows it");
  EXPECT_EQ(error_of({.interface = "can0", .signal = {}}),
            std::string("[wheel]: signal is not set; expected ") + kBusSignalForm);
}

std::vector<std::uint8_t> frame_bytes(std::uint32_t id, std::vector<std::uint8_t> data, bool fd = false) {
  canfd_frame frame{};
  frame.can_id = id;
  frame.len = static_cast<std::uint8_t>(data.size());
  std::memcpy(frame.data, data.data(), data.size());
  std::vector<std::uint8_t> bytes(fd ? CANFD_MTU : CAN_MTU);
  std::memcpy(bytes.data(), &frame, bytes.size());
  return bytes;
}

TEST(CanWheelSource, ReadsTheConfiguredSignalAndNothingElse) {
  CanWheelSource source(
      {.interface = "can0", .signal = {.id = 0x1a0, .start_bit = 16, .length = 16, .is_signed = true, .scale = 0.01}});
  const ArrivalStamps stamps{ClockPair::now().of_day_ns - 5 * kMs, 0};
  WheelSample sample;
  const std::int64_t before_ns = monotonic_ns();
  ASSERT_TRUE(source.decode(frame_bytes(0x1a0, {0, 0, 0xc8, 0xff}), stamps, sample));
  EXPECT_DOUBLE_EQ(sample.forward_speed_m_s, -0.56);
  EXPECT_TRUE(std::isnan(sample.yaw_rate_rad_s));
  EXPECT_LE(std::abs(sample.stamp.ns - (before_ns - 5 * kMs)), 50 * kMs);
  ASSERT_TRUE(source.decode(frame_bytes(0x1a0, {0, 0, 1, 0}, true), stamps, sample)) << "in a frame of CAN FD";
  EXPECT_DOUBLE_EQ(sample.forward_speed_m_s, 0.01);
  EXPECT_FALSE(source.decode(frame_bytes(0x1a1, {0, 0, 1, 0}), stamps, sample));
  EXPECT_FALSE(source.decode(frame_bytes(0x1a0 | CAN_EFF_FLAG, {0, 0, 1, 0}), stamps, sample));
  EXPECT_FALSE(source.decode(frame_bytes(0x1a0 | CAN_RTR_FLAG, {0, 0, 1, 0}), stamps, sample));
  EXPECT_FALSE(source.decode(frame_bytes(0x1a0 | CAN_ERR_FLAG, {0, 0, 1, 0}), stamps, sample));
  EXPECT_FALSE(source.decode(frame_bytes(0x1a0, {0, 0, 1}), stamps, sample));
  auto lying = frame_bytes(0x1a0, {0, 0, 1});
  lying[4] = 255;  // a length that no frame has: what the frame has room for is read, no more
  EXPECT_TRUE(source.decode(lying, stamps, sample));
  EXPECT_FALSE(source.decode({lying.data(), 7}, stamps, sample));
  EXPECT_EQ(source.counts().samples, 3u);
  CanWheelSource beyond({.interface = "can0", .signal = {.id = 0x1a0, .start_bit = 64, .length = 8}});
  EXPECT_FALSE(beyond.decode(lying, stamps, sample));
  EXPECT_EQ(beyond.counts().too_short, 1u);
  EXPECT_EQ(beyond.counts().not_finite, 0u);
  EXPECT_EQ(source.counts().too_short, 2u);
}

// ---- arrival ----

const ClockPair kNow{1'700'000'000 * kSecond, 5'000 * kSecond};
constexpr ClockPair later(const ClockPair& pair, std::int64_t by_ns, std::int64_t step_ns = 0) {
  return {pair.of_day_ns + by_ns + step_ns, pair.steady_ns + by_ns};
}

TEST(ArrivalClock, NeverInTheFutureNeverBackwardsNeverOld) {
  ArrivalClock clock;
  EXPECT_EQ(clock.arrival({kNow.of_day_ns + 3 * kMs, 0}, kNow).ns, kNow.steady_ns);
  EXPECT_EQ(clock.arrival({0, 0}, later(kNow, kMs)).ns, kNow.steady_ns + kMs);
  EXPECT_EQ(clock.arrival({kNow.of_day_ns - 2 * kSecond, 0}, later(kNow, 2 * kMs)).ns, kNow.steady_ns + 2 * kMs);
  EXPECT_EQ(clock.bad_stamps(), 3u);
  EXPECT_EQ(clock.arrival({kNow.of_day_ns - 9 * kMs, 0}, later(kNow, 3 * kMs)).ns, kNow.steady_ns + 2 * kMs);
}

// Somebody sets the clock while a frame waits. Frames come every 10 ms and wait 1 ms.
TEST(ArrivalClock, TheClockOfDayMayBeSet) {
  for (const std::int64_t step : {3'600 * kSecond, -3'600 * kSecond, 300 * kMs, -300 * kMs}) {
    ArrivalClock clock;
    for (int i = 0; i < 10; ++i) {
      const ClockPair now = later(kNow, i * 10 * kMs, i >= 5 ? step : 0);
      const std::int64_t stamp_step = i > 5 ? step : 0;  // the one of i = 5 came before the clock was set
      const ArrivalStamps stamps{kNow.of_day_ns + i * 10 * kMs - kMs + stamp_step, 0};
      EXPECT_EQ(clock.arrival(stamps, now).ns, now.steady_ns - kMs) << "step " << step << ", frame " << i;
    }
    EXPECT_EQ(clock.bad_stamps(), 0u);
  }
}

// An interface with a clock of its own, 40 ppm fast; interrupts come 0.1 to 2 ms late. Its stamps remove the lateness.
TEST(ArrivalClock, TheInterfacesClockTakesTheLatenessAway) {
  ArrivalClock clock;
  unsigned random = 1;
  double worst = 0;
  for (int i = 0; i < 3'000; ++i) {
    random = random * 1664525 + 1013904223;
    const std::int64_t at = i * 10 * kMs, late = 100'000 + static_cast<std::int64_t>(random >> 8) % (2 * kMs);
    const ClockPair now = later(kNow, at + late + 50'000);
    const ArrivalStamps stamps{kNow.of_day_ns + at + late, 77'000'000 + at + at / 25'000};
    const HostStamp arrival = clock.arrival(stamps, now);
    if (i > 1'000) worst = std::max(worst, std::abs(static_cast<double>(arrival.ns - (kNow.steady_ns + at + 100'000))));
  }
  EXPECT_LT(worst, 100'000) << "ns; without the hardware's stamps it is 2 ms";
  EXPECT_EQ(clock.hardware_state().status, ClockStatus::kLocked);
}

TEST(GapWatch, CountsGapsNotJitter) {
  GapWatch watch;
  int gaps = 0;
  std::int64_t at = 1'000 * kSecond;
  for (int i = 0; i < 200; ++i) {
    at += 10 * kMs + (i % 3 - 1) * 2 * kMs;
    if (i == 50 || i == 120) at += 100 * kMs;
    gaps += watch.is_after_gap(HostStamp{at}) ? 1 : 0;
  }
  EXPECT_EQ(gaps, 2);
}

}  // namespace
}  // namespace epiline
