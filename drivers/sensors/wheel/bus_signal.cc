#include "drivers/sensors/wheel/bus_signal.h"

#include <cmath>

#include "drivers/links/can/bits.h"
#include "drivers/links/can/signal.h"

namespace epiline {

namespace {

constexpr int kMostBytes = static_cast<int>(can::kFdBytes);

}  // namespace

int BusSignal::bytes() const noexcept {
  if (length < 1 || length > 64 || start_bit < 0 || start_bit >= 8 * kMostBytes) return 0;
  const int bytes = can::BitField{start_bit, length, big_endian}.bytes();
  return bytes <= kMostBytes ? bytes : 0;
}

std::optional<double> BusSignal::value(std::span<const std::uint8_t> data) const noexcept {
  const int needed = bytes();
  if (needed == 0 || data.size() < static_cast<std::size_t>(needed)) return std::nullopt;
  const std::uint64_t raw = can::get_bits(data, {start_bit, length, big_endian});
  const double number = is_signed ? static_cast<double>(can::signed_of(raw, length)) : static_cast<double>(raw);
  const double value = number * scale + offset;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace epiline
