#include "drivers/links/mavlink/controller_imu.h"

#include <gtest/gtest.h>

#include <limits>

#include "drivers/links/mavlink/odometry.h"
#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

HighresImu reading(std::uint64_t time_us) {
  return {.time_usec = time_us, .zacc = -9.81F, .zgyro = 0.5F, .fields_updated = 0x3f};
}

class MavlinkControllerImu : public ::testing::Test {
 protected:
  /// At `at_us` of the flight controller, `late` after that.
  bool take(HighresImu message, Span late = Span{2 * kMs}) {
    const HostStamp now = HostStamp{kBoot_ns + static_cast<std::int64_t>(message.time_usec) * 1000} + late;
    return imu.take(message, clock, now, sample);
  }
  TwoWaySync clock = settled_clock(50);
  ControllerImu imu{Span{}};
  ImuSample sample;
};

TEST_F(MavlinkControllerImu, TurnsAxesAndStampsByTheModel) {
  ASSERT_TRUE(take(reading(100'000'000)));
  EXPECT_NEAR(static_cast<double>(sample.stamp.ns), static_cast<double>(kBoot_ns + 100 * kSecond), 1e3);
  EXPECT_EQ(sample.arrival.ns, kBoot_ns + 100 * kSecond + 2 * kMs);
  EXPECT_NEAR(sample.specific_force_m_s2[2], 9.81, 1e-6);  // at rest, up
  EXPECT_EQ(sample.angular_velocity_rad_s[2], -0.5);       // to the right
}

TEST_F(MavlinkControllerImu, WaitsForTheClock) {
  clock = settled_clock(9);
  EXPECT_FALSE(take(reading(100'000'000)));
  EXPECT_EQ(imu.counts().no_clock, 1U);
  clock = settled_clock(10);
  EXPECT_TRUE(take(reading(100'005'000)));
}

TEST_F(MavlinkControllerImu, RefusesValuesNoSensorGives) {
  std::uint64_t time_us = 100'000'000;
  for (const float wrong :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e30F, 500.0F}) {
    for (float HighresImu::*field : {&HighresImu::xacc, &HighresImu::zacc, &HighresImu::xgyro, &HighresImu::zgyro}) {
      HighresImu message = reading(time_us += 5000);
      message.*field = wrong;
      EXPECT_FALSE(take(message));
    }
  }
  EXPECT_EQ(imu.counts().refused_values, 16U);
  HighresImu half = reading(time_us += 5000);
  half.fields_updated = 0x38;  // no accelerometer
  EXPECT_FALSE(take(half));
  EXPECT_EQ(imu.counts().readings, 0U);
}

TEST_F(MavlinkControllerImu, RefusesTimesThatCannotBe) {
  ASSERT_TRUE(take(reading(100'000'000)));
  const HostStamp now{kBoot_ns + 100 * kSecond + 10 * kMs};
  for (const std::uint64_t wrong :
       {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{100'100'000}, std::uint64_t{99'000'000},
        std::uint64_t{1'763'000'000'000'000}, std::numeric_limits<std::uint64_t>::max()}) {
    EXPECT_FALSE(imu.take(reading(wrong), clock, now, sample)) << wrong;
  }
  EXPECT_EQ(imu.counts().refused_times, 6U);
  EXPECT_TRUE(take(reading(100'005'000)));   // and none of them is remembered
  EXPECT_FALSE(take(reading(100'005'100)));  // 10 kHz
}

TEST_F(MavlinkControllerImu, CountsDuplicatesAndGaps) {
  std::uint64_t time_us = 100'000'000;
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(take(reading(time_us += 5000)));
  EXPECT_FALSE(take(reading(time_us)));
  EXPECT_FALSE(take(reading(time_us - 5000), Span{7 * kMs}));
  EXPECT_EQ(imu.counts().duplicates, 2U);
  EXPECT_EQ(imu.counts().lost, 0U);
  ASSERT_TRUE(take(reading(time_us += 20'000)));
  EXPECT_EQ(imu.counts().lost, 3U);
}

TEST_F(MavlinkControllerImu, KeepsToOneSensor) {
  std::uint64_t time_us = 100'000'000;
  HighresImu second = reading(0);
  second.id = 1;
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(take(reading(time_us += 5000)));
    second.time_usec = time_us + 1000;
    EXPECT_FALSE(take(second));
  }
  EXPECT_EQ(imu.counts().others, 10U);
  second.time_usec = time_us + 2'500'000;  // the first has failed
  EXPECT_TRUE(take(second));
}

TEST_F(MavlinkControllerImu, PrefersTheBetterMessage) {
  RawImu raw{.time_usec = 100'000'000, .zacc = -1000, .zgyro = 500};
  const auto take_raw = [&] {
    return imu.take(raw, clock, HostStamp{kBoot_ns + static_cast<std::int64_t>(raw.time_usec) * 1000 + kMs}, sample);
  };
  ASSERT_TRUE(take_raw());
  ASSERT_TRUE(take(reading(100'005'000)));
  raw.time_usec = 100'010'000;
  EXPECT_FALSE(take_raw());
  EXPECT_EQ(imu.counts().others, 1U);
}

// Thousandths of rad/s and of 9.80665 m/s^2, about forward, right and down; ours are forward, left and up.
TEST(MavlinkOdometry, RawReadingsAreInArduPilotsUnits) {
  const ImuSample sample =
      imu_sample(RawImu{.xacc = 100, .yacc = 200, .zacc = -1000, .xgyro = 300, .ygyro = -400, .zgyro = 500});
  const std::array<double, 3> rate = {0.3, 0.4, -0.5}, force = {0.980665, -1.96133, 9.80665};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(sample.angular_velocity_rad_s[i], rate[i], 1e-12) << i;
    EXPECT_NEAR(sample.specific_force_m_s2[i], force[i], 1e-12) << i;
  }
}

// Older ArduPilots fill RAW_IMU with the lower 32 bits of their microseconds: 71 minutes.
TEST_F(MavlinkControllerImu, UnwrapsThirtyTwoBits) {
  constexpr std::int64_t kUp_us = (std::int64_t{3} << 32) + 5'000'000;
  const TwoWaySync old = settled_clock(20, kUp_us * 1000 + 2 * kSecond);
  const RawImu raw{.time_usec = 5'000'000 + 1'900'000, .zacc = -1000};
  const HostStamp now{kBoot_ns + (kUp_us + 1'902'000) * 1000};
  ASSERT_TRUE(imu.take(raw, old, now, sample));
  EXPECT_NEAR(static_cast<double>((now - sample.stamp).ns), 2e6, 1e3);
}

}  // namespace
}  // namespace epiline::mavlink
