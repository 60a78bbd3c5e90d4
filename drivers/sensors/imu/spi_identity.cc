#include "drivers/sensors/imu/spi_identity.h"

#include <cstddef>

#include "drivers/sensors/trouble.h"

namespace epiline {

namespace {

struct KnownChip {
  unsigned identity;
  const char* name;
};

// WHO_AM_I or CHIP_ID of chips that sit on the same kinds of boards.
constexpr KnownChip kKnownChips[] = {
    {0x47, "an ICM-42688-P"},
    {0x44, "an ICM-42686-P"},
    {0x42, "an ICM-42605"},
    {0x40, "an ICM-42600"},
    {0x41, "an ICM-42602"},
    {0x46, "an ICM-42622"},
    {0x6f, "an IIM-42652"},
    {0xdb, "an ICM-42688-V"},
    {0x12, "an ICM-20602"},
    {0x98, "an ICM-20689"},
    {0xaf, "an ICM-20608"},
    {0xea, "an ICM-20948"},
    {0x71, "an MPU-9250"},
    {0x68, "an MPU-6000"},
    {0x1e, "the accelerometer of a BMI088"},
    {0x0f, "the gyroscope of a BMI088"},
    {0x1a, "the accelerometer of a BMI090L"},
    {0xd1, "a BMI160"},
    {0x24, "a BMI270"},
    {0x6c, "an LSM6DSO"},
};

/// `dummies`: an accelerometer of a BMI088 sends a byte before its answer.
unsigned identity_at(SpiBus& bus, std::uint8_t address, std::size_t dummies = 0) noexcept {
  std::uint8_t identity = 0;
  return bus.read_bytes(address, {&identity, 1}, dummies) == 0 ? identity : 0;
}

const char* name_of(unsigned identity) noexcept {
  for (const KnownChip& chip : kKnownChips)
    if (chip.identity == identity) return chip.name;
  return nullptr;
}

}  // namespace

SpiChip ask_identity(SpiBus& bus) noexcept {
  constexpr int kMode = 0, kSlow_hz = 1'000'000;  // all of them understand both
  if (bus.open(kMode, kSlow_hz)) return SpiChip::kUnknown;
  SpiChip chip = SpiChip::kUnknown;
  if (identity_at(bus, 0x75) == 0x47) {
    chip = SpiChip::kIcm42688p;
  } else if (identity_at(bus, 0x00) == 0x0f) {
    chip = SpiChip::kBmi088Gyroscope;
  } else if (identity_at(bus, 0x00, 1) == 0x1e) {  // the questions before have made it listen to SPI
    chip = SpiChip::kBmi088Accelerometer;
  }
  bus.close();
  return chip;
}

DeviceTrouble wrong_identity(unsigned found, unsigned wanted) noexcept {
  const unsigned all = wanted > 0xff ? 0xffff : 0xff;
  const char* likely = "Is the clock too fast (imu.spi_hz), or is it another chip?";
  const char* name = found <= 0xff ? name_of(found) : nullptr;
  if (found == 0) {
    likely = "Wrong chip select, MISO not connected, or no supply?";
  } else if (found == all) {
    likely = "Wrong chip select, no supply, or MISO open?";
  } else if (name != nullptr) {
    likely = "Wrong chip select, or wrong imu.driver?";
  } else if (found == wanted >> 1 || found == (wanted >> 1 | (all + 1) >> 1) || found == ((wanted << 1) & all) ||
             found == (((wanted << 1) | 1) & all)) {
    likely = "The bits are shifted by one: wrong SPI mode, or a clock too fast for the wires (imu.spi_hz)?";
  }
  return expecting(unexpected("identity register", "", "wrong identity 0x%02x%s%s", found, name != nullptr ? ", " : "",
                              name != nullptr ? name : ""),
                   "0x%02x. %s", wanted, likely);
}

DeviceTrouble wrong_register(const char* step, unsigned bank, unsigned address, unsigned found,
                             unsigned wanted) noexcept {
  return expecting(unexpected(step, "", "register 0x%02x of bank %u reads 0x%02x", address, bank, found),
                   "0x%02x, as written. Does the supply dip, or is the clock too fast (imu.spi_hz)?", wanted);
}

}  // namespace epiline
