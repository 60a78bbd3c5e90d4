#pragma once
// What an IMU shakes with: the spectrum of its newest readings.
#include <array>
#include <cstddef>
#include <vector>

#include "platform/samples/samples.h"

namespace epiline {

/// Amplitude densities per sqrt(Hz), root of the three axes' sum of squares; element i is at (i + 1) * step_hz. Empty:
/// too few readings.
struct ImuSpectrum {
  double step_hz = 0;
  std::vector<double> gyroscope, accelerometer;     ///< rad/s/sqrt(Hz), m/s^2/sqrt(Hz)
  double gyroscope_rms = 0, accelerometer_rms = 0;  ///< rad/s, m/s^2: of all that is faster than a hand
};

inline constexpr double kFasterThanAHand_hz = 8;

class SpectrumWindow {
 public:
  static constexpr std::size_t kReadings = 512;
  void step(const ImuSample& reading);
  ImuSpectrum result() const;

 private:
  std::array<std::array<double, 6>, kReadings> ring_{};
  std::array<HostStamp, kReadings> stamps_{};
  std::size_t count_ = 0;
};

}  // namespace epiline
