#pragma once
// White noise of IMUs at rest as their data sheets give it, to compare a measured one with.
#include <array>
#include <numbers>
#include <string_view>

namespace epiline {

struct ImuNoiseFigures {
  std::string_view chip;               ///< ChipFacts::name
  double gyroscope_rad_s_sqrt_hz = 0;  ///< typical, of the worst axis
  double accelerometer_m_s2_sqrt_hz = 0;
};

namespace detail {
constexpr ImuNoiseFigures noise_figures(std::string_view chip, double gyroscope_mdeg_s, double accelerometer_ug) {
  return {chip, gyroscope_mdeg_s * 1e-3 * std::numbers::pi / 180, accelerometer_ug * 1e-6 * 9.80665};
}
}  // namespace detail

/// deg/s/1000 and g/1000000, each for a bandwidth of 1 Hz. Of the BMI088's and the ADIS16470's accelerometers the sheet
/// itself was not at hand: those two are the commonly quoted figures.
inline constexpr std::array kImuNoise = {
    detail::noise_figures("ICM-42688-P", 2.8, 70),  // DS-000347, first page
    detail::noise_figures("BMI088", 14, 190),       // BST-BMI088-DS001, specification: 160 in x and y
    detail::noise_figures("ADIS16470", 8, 100),     // data sheet, revision C, first page
};

/// nullptr: not a chip of the table.
constexpr const ImuNoiseFigures* noise_of(std::string_view chip) {
  for (const ImuNoiseFigures& figures : kImuNoise)
    if (figures.chip == chip) return &figures;
  return nullptr;
}

}  // namespace epiline
