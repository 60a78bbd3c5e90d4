#pragma once
// A signal in the CAN frames of another device, as a DBC file describes it.
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace epiline {

/// `start_bit` counts as in can::BitField.
struct BusSignal {
  int start_bit = 0, length = 16;  ///< bits; 1 to 64
  bool big_endian = false, is_signed = true;
  double scale = 1, offset = 0;

  /// Bytes a frame must have to hold it; 0: it fits none.
  int bytes() const noexcept;
  /// Nothing if the frame is too short, or if what it says is no finite number.
  std::optional<double> value(std::span<const std::uint8_t> data) const noexcept;
};

}  // namespace epiline
