#include "drivers/program/check/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace epiline {
namespace {

constexpr double kRate_hz = 200;

ImuSample sample(int i, double gyroscope_x, double accelerometer_z) {
  ImuSample s;
  s.stamp = {1'000'000'000 + static_cast<std::int64_t>(i * 1e9 / kRate_hz)};
  s.angular_velocity_rad_s = {gyroscope_x, 0, 0};
  s.specific_force_m_s2 = {0, 0, accelerometer_z};
  return s;
}

TEST(Spectrum, AVibrationIsAtItsFrequencyWithItsStrength) {
  constexpr double kHz = 62.5, kAmplitude = 0.8;
  SpectrumWindow window;
  for (int i = 0; i < 700; ++i)
    window.step(sample(i, 0.1, 9.81 + kAmplitude * std::sin(2 * std::numbers::pi * kHz * i / kRate_hz)));
  const ImuSpectrum s = window.result();
  ASSERT_FALSE(s.accelerometer.empty());
  std::size_t peak = 0;
  for (std::size_t i = 0; i < s.accelerometer.size(); ++i)
    if (s.accelerometer[i] > s.accelerometer[peak]) peak = i;
  EXPECT_NEAR(s.step_hz * static_cast<double>(peak + 1), kHz, s.step_hz);
  EXPECT_NEAR(s.accelerometer_rms, kAmplitude / std::sqrt(2), 0.01 * kAmplitude);
  EXPECT_LT(s.gyroscope_rms, 1e-9) << "a constant is no vibration";
}

TEST(Spectrum, WhiteNoiseHasTheDensityItWasMadeWith) {
  constexpr double kDensity = 0.002;
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, kDensity * std::sqrt(kRate_hz / 2));  // one-sided
  double squares = 0, count = 0;
  SpectrumWindow window;
  for (int i = 0; i < 20 * 512; ++i) {
    window.step(sample(i, normal(random), 9.81));
    if (i % 512 != 511) continue;
    for (const double d : window.result().gyroscope) {
      squares += d * d;
      ++count;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / count), kDensity, 0.03 * kDensity);
}

TEST(Spectrum, NeedsAFullWindowAndLeavesOutWhatIsNotFinite) {
  SpectrumWindow window;
  for (int i = 0; i < 511; ++i) window.step(sample(i, 0, 9.81));
  EXPECT_TRUE(window.result().accelerometer.empty());
  window.step(sample(511, std::nan(""), 9.81));
  EXPECT_TRUE(window.result().accelerometer.empty());
  window.step(sample(512, 0, 9.81));
  EXPECT_FALSE(window.result().accelerometer.empty());
}

}  // namespace
}  // namespace epiline
