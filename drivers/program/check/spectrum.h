#pragma once
// Vibration of an IMU: the spectrum of its newest samples.
#include <array>
#include <cstddef>
#include <vector>

#include "platform/samples/samples.h"

namespace epiline {

/// Amplitude spectral densities: root of the sum of squares over the three axes. Element i is at (i + 1) * step_hz.
/// Empty: too few samples.
struct ImuSpectrum {
  double step_hz = 0;
  std::vector<double> gyroscope, accelerometer;     ///< rad/s/sqrt(Hz), m/s^2/sqrt(Hz)
  double gyroscope_rms = 0, accelerometer_rms = 0;  ///< rad/s, m/s^2, above kFasterThanAHand_hz
};

inline constexpr double kFasterThanAHand_hz = 8;

/// Angular velocity, rad/s, and specific force, m/s^2.
using ImuAxes = std::array<double, 6>;
ImuAxes axes_of(const ImuSample& sample);
bool is_finite(const ImuAxes& axes);

class SpectrumWindow {
 public:
  static constexpr std::size_t kReadings = 512;
  void step(const ImuSample& reading);
  ImuSpectrum result() const;

 private:
  std::array<ImuAxes, kReadings> ring_{};
  std::array<HostStamp, kReadings> stamps_{};
  std::size_t count_ = 0;
};

}  // namespace epiline
