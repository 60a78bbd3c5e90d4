#include "drivers/program/check/spectrum.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace epiline {

namespace {

/// Squared amplitude density of each frequency but 0, one-sided, through a Hann window. The mean is taken off before.
void add_density(const std::vector<double>& values, double rate_hz, std::vector<double>& sums) {
  const auto n = static_cast<double>(values.size());
  double mean = 0, weights = 0;
  for (const double v : values) mean += v / n;
  std::vector<double> windowed;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double weight = 0.5 - 0.5 * std::cos(2 * std::numbers::pi * (static_cast<double>(i) + 0.5) / n);
    weights += weight * weight;
    windowed.push_back(weight * (values[i] - mean));
  }
  for (std::size_t k = 0; k < sums.size(); ++k) {
    // Goertzel's recursion
    const double c = 2 * std::cos(2 * std::numbers::pi * static_cast<double>(k + 1) / n);
    double one = 0, two = 0;
    for (const double v : windowed) {
      const double now = v + c * one - two;
      two = one;
      one = now;
    }
    sums[k] += 2 * (one * one + two * two - c * one * two) / (weights * rate_hz);
  }
}

double rms_above(const std::vector<double>& density, double step_hz) {
  double sum = 0;
  for (std::size_t i = 0; i < density.size(); ++i)
    if (step_hz * static_cast<double>(i + 1) >= kFasterThanAHand_hz) sum += step_hz * density[i] * density[i];
  return std::sqrt(sum);
}

}  // namespace

ImuAxes axes_of(const ImuSample& sample) {
  const auto& w = sample.angular_velocity_rad_s;
  const auto& a = sample.specific_force_m_s2;
  return {w[0], w[1], w[2], a[0], a[1], a[2]};
}

bool is_finite(const ImuAxes& axes) {
  return std::all_of(axes.begin(), axes.end(), [](double v) { return std::isfinite(v); });
}

void SpectrumWindow::step(const ImuSample& r) {
  const ImuAxes axes = axes_of(r);
  if (!is_finite(axes)) return;
  ring_[count_ % kReadings] = axes;
  stamps_[count_ % kReadings] = r.stamp;
  ++count_;
}

ImuSpectrum SpectrumWindow::result() const {
  ImuSpectrum spectrum;
  if (count_ < kReadings) return spectrum;
  const double seconds = (stamps_[(count_ - 1) % kReadings] - stamps_[count_ % kReadings]).seconds();
  if (!(seconds > 0)) return spectrum;
  const double rate_hz = (kReadings - 1) / seconds;
  spectrum.step_hz = rate_hz / kReadings;
  spectrum.gyroscope.assign(kReadings / 2 - 1, 0);
  spectrum.accelerometer = spectrum.gyroscope;
  std::vector<double> values(kReadings);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    for (std::size_t i = 0; i < kReadings; ++i) values[i] = ring_[(count_ + i) % kReadings][axis];
    add_density(values, rate_hz, axis < 3 ? spectrum.gyroscope : spectrum.accelerometer);
  }
  for (auto* density : {&spectrum.gyroscope, &spectrum.accelerometer})
    for (double& value : *density) value = std::sqrt(value);
  spectrum.gyroscope_rms = rms_above(spectrum.gyroscope, spectrum.step_hz);
  spectrum.accelerometer_rms = rms_above(spectrum.accelerometer, spectrum.step_hz);
  return spectrum;
}

}  // namespace epiline
