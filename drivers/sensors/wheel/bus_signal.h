#pragma once
// Values of signals in the CAN frames of another device.
#include <cstdint>
#include <optional>
#include <span>

#include "pipeline/config/bus_signal.h"

namespace epiline {

/// Bytes a frame must have to hold it; 0: it fits none.
int bytes_of(const BusSignal& signal) noexcept;
/// Nothing if the frame is too short, or if what it says is no finite number.
std::optional<double> value_of(const BusSignal& signal, std::span<const std::uint8_t> data) noexcept;

}  // namespace epiline
