#pragma once
#include <cstdint>
#include <span>

#include "drivers/sensors/imu/spi_bus.h"

namespace epiline {

/// What it most likely means that a chip's identity register reads `found` instead of `wanted`.
DeviceTrouble wrong_identity(unsigned found, unsigned wanted) noexcept;

/// A register that does not hold what was written; banks and addresses as in the data sheet.
DeviceTrouble wrong_register(const char* step, unsigned bank, unsigned address, unsigned found,
                             unsigned wanted) noexcept;

}  // namespace epiline
