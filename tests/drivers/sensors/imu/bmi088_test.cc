#include "drivers/sensors/imu/bmi088.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/drivers/sensors/imu/chip_rigs.h"

namespace epiline {
namespace {

using namespace epiline::test;

TEST(Bmi088, DelayFollowsFromTheBandwidth) {
  BmiRig rig(at_rate(400));
  EXPECT_NEAR(rig.imu->facts().gyroscope_delay.seconds(), std::sqrt(2.0) / (2 * std::numbers::pi * 47), 1e-6);
  EXPECT_NEAR(rig.imu->facts().accelerometer_delay.seconds(), std::sqrt(2.0) / (2 * std::numbers::pi * 75), 1e-6);
}

TEST(Bmi088, SaysWhoIsThereInstead) {
  BmiRig swapped(at_rate(400), true, {}, true);
  std::string told = text(swapped.imu->open());
  EXPECT_NE(told.find("imu.device and imu.device_accel swapped"), std::string::npos) << told;
  BmiRig open_line(at_rate(400));
  open_line.accel_bus->stuck = 0xff;
  told = text(open_line.imu->open());
  EXPECT_NE(told.find("wrong identity 0xff [identity register of the accelerometer]; expected 0x1e"), std::string::npos)
      << told;
  BmiRig dead(at_rate(400));
  dead.gyro_bus->stuck = 0;
  told = text(dead.imu->open());
  EXPECT_NE(told.find("wrong identity 0x00 [identity register of the gyroscope]"), std::string::npos) << told;
}

TEST(Bmi088, FifosThatRanOverAreEmptied) {
  BmiRig rig(at_rate(400));
  ASSERT_EQ(text(rig.imu->open()), "well");
  for (const std::int64_t stall_ms : {150, 200, 400}) {  // the accelerometer's holds 146 frames of 1.25 ms
    rig.read_for(1);
    rig.world->now_ns += stall_ms * 1'000'000;
    rig.model.run(rig.world->now_ns);
  }
  ASSERT_GT(rig.model.gyro_overflows, 0U);
  ASSERT_GT(rig.model.accel_overflows, 0U);
  rig.read_for(1);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_EQ(rig.imu->counts().overflows, 1U);
  EXPECT_LT(result.worst_late_ns + result.worst_early_ns, 20'000);
  EXPECT_LT(result.worst_accel_m_s2, 0.0052);
  EXPECT_GT(result.samples, 1500U);
}

// Frames by hand, from section 4.9.
TEST(BmiFrames, AreReadUpToTheTime) {
  const std::vector<std::uint8_t> bytes{0x84, 1, 0,    0xff, 0xff, 0,    0x80, 0x48, 0x01, 0x87, 2, 1, 4, 3,
                                        6,    5, 0x44, 0x10, 0x20, 0x30, 0x84, 9,    9,    9,    9, 9, 9};
  BmiAccelFrames frames;
  ASSERT_TRUE(parse_bmi_accel(bytes, frames));
  ASSERT_EQ(frames.values.size(), 2U);
  EXPECT_EQ(frames.values[0], (BmiVector{1, -1, -32768}));
  EXPECT_EQ(frames.values[1], (BmiVector{0x0102, 0x0304, 0x0506}));
  EXPECT_TRUE(frames.has_time);
  EXPECT_EQ(frames.time, 0x302010U);
}

TEST(BmiFrames, WhatCameBeforeAGapIsNotInARow) {
  const std::vector<std::uint8_t> bytes{0x84, 1, 0, 1, 0, 1, 0, 0x40, 7, 0x84, 2, 0, 2, 0, 2, 0, 0x84, 3};
  BmiAccelFrames frames;
  ASSERT_TRUE(parse_bmi_accel(bytes, frames));
  ASSERT_EQ(frames.values.size(), 1U);
  EXPECT_EQ(frames.skipped, 7U);
  EXPECT_FALSE(frames.has_time);
}

TEST(BmiFrames, AnotherHeaderIsDamage) {
  BmiAccelFrames frames;
  EXPECT_FALSE(parse_bmi_accel(std::vector<std::uint8_t>{0x12, 0, 0, 0}, frames));
  EXPECT_TRUE(parse_bmi_accel(std::vector<std::uint8_t>{0x80, 0, 0, 0}, frames));
}

}  // namespace
}  // namespace epiline
