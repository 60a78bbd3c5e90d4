#include "drivers/sensors/imu/adis16470_burst.h"

#include "platform/error/contract.h"

namespace epiline {

bool parse_adis_burst(std::span<const std::uint8_t> bytes, AdisBurst& burst) noexcept {
  EPILINE_EXPECTS(bytes.size() >= AdisBurst::kBytes, "a whole burst");
  constexpr std::size_t kSummed = AdisBurst::kBytes - 2;
  const auto word = [&](std::size_t i) { return static_cast<std::uint16_t>(bytes[2 * i] << 8 | bytes[2 * i + 1]); };
  unsigned sum = 0;
  for (std::size_t i = 0; i < kSummed; ++i) sum += bytes[i];
  if (sum == 0 || sum != word(9)) return false;
  burst.status = word(0);
  for (std::size_t i = 0; i < 3; ++i) {
    burst.gyro[i] = static_cast<std::int16_t>(word(1 + i));
    burst.accel[i] = static_cast<std::int16_t>(word(4 + i));
  }
  burst.temperature_c = static_cast<std::int16_t>(word(7)) * 0.1;
  burst.counter = word(8);
  return true;
}

}  // namespace epiline
