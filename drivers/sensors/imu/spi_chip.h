#pragma once
// What the drivers of chips share: units of data sheets, ranges, registers that are read back.
#include <cstddef>
#include <numbers>
#include <span>

#include "drivers/sensors/imu/spi_bus.h"
#include "drivers/sensors/imu/spi_identity.h"

namespace epiline {

inline constexpr double kGravity_m_s2 = 9.80665, kRadPerDeg = std::numbers::pi / 180;

/// The place of the smallest range that is enough, in a list from the largest to the smallest; a hundredth is given
/// away for rounded figures. -1: none is.
constexpr int smallest_range(std::span<const double> ranges, double wanted) noexcept {
  int place = -1;
  for (std::size_t i = 0; i < ranges.size(); ++i)
    if (ranges[i] * 1.01 >= wanted) place = static_cast<int>(i);
  return place;
}

/// `read(value)` reads a register; false: the bus failed with `bus_error`. A value that is not `wanted` in the bits of
/// `mask` may be garbled, so it is read once more. If it is still wrong, returns `trouble_of(found)`.
template <class Value, class Read, class TroubleOf>
DeviceTrouble read_back(Value wanted, Value mask, const int& bus_error, Read read, TroubleOf trouble_of) noexcept {
  Value value = 0;
  for (int attempt = 0; attempt < 2; ++attempt) {
    if (!read(value)) return device_refusal("read back", bus_error);
    if ((value & mask) == wanted) return {};
  }
  return trouble_of(static_cast<unsigned>(value & mask));
}

}  // namespace epiline
