#pragma once
// Heights from air pressures.
#include <cmath>

namespace epiline {

inline constexpr double kStandardPressure_hpa = 1013.25;  ///< at sea level, of the standard atmosphere

/// Whether a barometer in air may read that: from 16 km up to deep mines. False for what is no number.
inline bool is_air_pressure(double hpa) noexcept { return hpa > 100 && hpa < 1200; }

/// Height difference from the pressure `from_hpa` up to `to_hpa` in air of that temperature at the ground, m. Good to
/// 0.2 % over 150 m.
inline double height_between(double from_hpa, double to_hpa, double air_deg) noexcept {
  constexpr double kGasOverWeight = 8.314462 / (0.0289644 * 9.80665);  // m/K, of dry air
  return kGasOverWeight * (273.15 + air_deg) * std::log(from_hpa / to_hpa);
}

}  // namespace epiline
