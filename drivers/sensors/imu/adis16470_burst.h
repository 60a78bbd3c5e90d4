#pragma once
// The burst of an ADIS16470: data sheet, revision C, "Burst read function".
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace epiline {

struct AdisBurst {
  static constexpr std::size_t kBytes = 20;  ///< after the command
  std::uint16_t status = 0;                  ///< DIAG_STAT
  std::array<std::int16_t, 3> gyro{}, accel{};
  double temperature_c = 0;
  std::uint16_t counter = 0;  ///< DATA_CNTR
};

/// `bytes` has at least AdisBurst::kBytes. False: the checksum is wrong, or all is 0, which no chip sends.
bool parse_adis_burst(std::span<const std::uint8_t> bytes, AdisBurst& burst) noexcept;

}  // namespace epiline
