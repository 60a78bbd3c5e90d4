#include "drivers/sensors/imu/adis16470.h"

#include <gtest/gtest.h>

#include "tests/drivers/sensors/imu/chip_rigs.h"

namespace epiline {
namespace {

using namespace epiline::test;

TEST(Adis16470, SamplesThatNobodyReadAreCountedAndShiftNothing) {
  AdisRig rig(at_rate(400), true, {.stall_share = 0.1, .stall_most_ms = 20, .edge_jitter_us = 0});
  rig.model.clock_error = -0.01;
  rig.open();
  const std::uint64_t lost_before = rig.imu->counts().lost;
  rig.read_for(10);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_GT(result.missing, 100U);
  EXPECT_NEAR(static_cast<double>(rig.imu->counts().lost - lost_before), static_cast<double>(result.missing), 10);
  EXPECT_LE(result.worst_ns(), 20'000);
}

TEST(Adis16470, BurstsStayBelowTheirOwnLimit) {
  ImuDeviceConfig config = at_rate(200);
  config.spi_hz = 2'000'000;
  AdisRig rig(config);
  rig.open(1);
  EXPECT_EQ(rig.imu->counts().damaged, 0U);
  EXPECT_GT(rig.compared().samples, 190U);
}

TEST(Adis16470, BitErrorsGoIntoTheChecksum) {
  AdisRig rig(at_rate(200), true, {.edge_jitter_us = 0});
  rig.open();
  rig.bus->bit_error_rate = 1e-3;
  rig.read_for(30);
  const Comparison result = rig.compared();
  EXPECT_EQ(result.unknown, 0U);
  EXPECT_GT(result.samples, 5000U);
  EXPECT_LE(result.worst_ns(), 100'000);
}

TEST(AdisBurst, IsReadByHand) {
  std::vector<std::uint8_t> bytes{0x00, 0x08, 0x00, 0x0a, 0xff, 0xf6, 0x00, 0x00, 0x03, 0x20,
                                  0x80, 0x00, 0x00, 0x01, 0x00, 0xfa, 0x12, 0x34, 0x00, 0x00};
  unsigned sum = 0;
  for (std::size_t i = 0; i < 18; ++i) sum += bytes[i];
  bytes[18] = static_cast<std::uint8_t>(sum >> 8);
  bytes[19] = static_cast<std::uint8_t>(sum);
  AdisBurst burst;
  ASSERT_TRUE(parse_adis_burst(bytes, burst));
  EXPECT_EQ(burst.status, 8);
  EXPECT_EQ(burst.gyro, (std::array<std::int16_t, 3>{10, -10, 0}));
  EXPECT_EQ(burst.accel, (std::array<std::int16_t, 3>{800, -32768, 1}));
  EXPECT_DOUBLE_EQ(burst.temperature_c, 25);
  EXPECT_EQ(burst.counter, 0x1234);
  for (std::size_t i = 0; i < 20; ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::uint8_t> wrong = bytes;
      wrong[i] ^= static_cast<std::uint8_t>(1 << bit);
      EXPECT_FALSE(parse_adis_burst(wrong, burst));
    }
  }
  EXPECT_FALSE(parse_adis_burst(std::vector<std::uint8_t>(20, 0), burst));
}

}  // namespace
}  // namespace epiline
