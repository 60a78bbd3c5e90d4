#include "drivers/sensors/imu/bmi088.h"

#include <gtest/gtest.h>

#include <vector>

namespace epiline {
namespace {

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
