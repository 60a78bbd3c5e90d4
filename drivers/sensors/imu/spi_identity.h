#pragma once
// Which chip is on an SPI bus, by its identity register.
#include <cstdint>
#include <span>

#include "drivers/sensors/imu/spi_bus.h"

namespace epiline {

enum class SpiChip : std::uint8_t { kUnknown, kIcm42688p, kBmi088Gyroscope, kBmi088Accelerometer };

/// Opens the bus, reads identity registers, closes it. Writes no register, and leaves a running chip as it is.
/// kUnknown: another chip, or none, or the bus cannot be opened.
SpiChip ask_identity(SpiBus& bus) noexcept;

/// What it most likely means that a chip's identity register reads `found` instead of `wanted`.
DeviceTrouble wrong_identity(unsigned found, unsigned wanted) noexcept;

/// A register that does not hold what was written; banks and addresses as in the data sheet.
DeviceTrouble wrong_register(const char* step, unsigned bank, unsigned address, unsigned found,
                             unsigned wanted) noexcept;

}  // namespace epiline
