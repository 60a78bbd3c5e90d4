#include "drivers/sensors/wheel/bus_signal.h"

#include <cmath>

namespace epiline {

namespace {

constexpr int kMostBits = 8 * 64;

/// Big-endian bits count on from the highest of byte 0; a DBC file counts each byte's from its lowest.
int in_reading_order(int dbc_bit) { return dbc_bit / 8 * 8 + 7 - dbc_bit % 8; }

}  // namespace

int BusSignal::bytes() const noexcept {
  if (length < 1 || length > 64 || start_bit < 0 || start_bit >= kMostBits) return 0;
  const int first = big_endian ? in_reading_order(start_bit) : start_bit;
  const int last = first + length - 1;
  return last < kMostBits ? last / 8 + 1 : 0;
}

std::optional<double> BusSignal::value(std::span<const std::uint8_t> data) const noexcept {
  const int needed = bytes();
  if (needed == 0 || data.size() < static_cast<std::size_t>(needed)) return std::nullopt;
  const int first = big_endian ? in_reading_order(start_bit) : start_bit;
  std::uint64_t raw = 0;
  for (int i = 0; i < length; ++i) {  // from the highest bit to the lowest
    const int at = big_endian ? first + i : first + length - 1 - i;
    const int shift = big_endian ? 7 - at % 8 : at % 8;
    raw = raw << 1 | (data[static_cast<std::size_t>(at / 8)] >> shift & 1U);
  }
  const bool negative = is_signed && (raw >> (length - 1) & 1) != 0;
  if (negative && length < 64) raw |= ~std::uint64_t{0} << length;
  const double number = is_signed ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
  const double value = number * scale + offset;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace epiline
