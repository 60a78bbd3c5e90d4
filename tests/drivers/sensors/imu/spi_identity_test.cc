// Chips say who they are, and stay as they were.
#include "drivers/sensors/imu/spi_identity.h"

#include <gtest/gtest.h>

#include "tests/drivers/sensors/imu/bmi_model.h"
#include "tests/drivers/sensors/imu/icm_model.h"

namespace epiline {
namespace {

TEST(SpiIdentity, ChipsAreKnown) {
  test::SpiWorld world({});
  test::IcmModel icm(world);
  test::IcmBus icm_bus(icm);
  EXPECT_EQ(ask_identity(icm_bus), SpiChip::kIcm42688p);
  EXPECT_EQ(icm.resets, 0);
  EXPECT_EQ(icm_bus.times_closed, icm_bus.times_opened);
  test::BmiModel bmi(world);
  test::BmiGyroBus gyroscope(bmi);
  test::BmiAccelBus accelerometer(bmi);
  EXPECT_EQ(ask_identity(gyroscope), SpiChip::kBmi088Gyroscope);
  EXPECT_EQ(ask_identity(accelerometer), SpiChip::kBmi088Accelerometer);
  EXPECT_EQ(ask_identity(accelerometer), SpiChip::kBmi088Accelerometer) << "again";
}

TEST(SpiIdentity, OthersAreNot) {
  test::SpiWorld world({});
  test::IcmModel chip(world);
  test::IcmBus bus(chip);
  for (const unsigned identity : {0x00U, 0xffU, 0x44U, 0x23U}) {
    chip.who_am_i = static_cast<std::uint8_t>(identity);
    chip.power_on();
    EXPECT_EQ(ask_identity(bus), SpiChip::kUnknown) << identity;
  }
  chip.who_am_i = 0x47;
  chip.power_on();
  bus.fail_next = 3;
  bus.fail_error = EIO;
  EXPECT_EQ(ask_identity(bus), SpiChip::kUnknown);
  bus.open_error = EACCES;
  EXPECT_EQ(ask_identity(bus), SpiChip::kUnknown);
}

}  // namespace
}  // namespace epiline
