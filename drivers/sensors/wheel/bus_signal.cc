#include "drivers/sensors/wheel/bus_signal.h"

#include <cmath>

#include "drivers/links/can/bits.h"

namespace epiline {

int bytes_of(const BusSignal& s) noexcept {
  return fits(s) ? can::BitField{s.start_bit, s.length, s.big_endian}.bytes() : 0;
}

std::optional<double> value_of(const BusSignal& s, std::span<const std::uint8_t> data) noexcept {
  const int needed = bytes_of(s);
  if (needed == 0 || data.size() < static_cast<std::size_t>(needed)) return std::nullopt;
  const std::uint64_t raw = can::get_bits(data, {s.start_bit, s.length, s.big_endian});
  const double number = s.is_signed ? static_cast<double>(can::signed_of(raw, s.length)) : static_cast<double>(raw);
  const double value = number * s.scale + s.offset;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace epiline
