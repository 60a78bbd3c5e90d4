#pragma once
// Judges an IMU by its samples: rate, noise at rest, gravity.
#include <array>
#include <cstdint>
#include <vector>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Allan deviation over averaging times of 1, 2, 4, ... samples, on the fly, in fixed memory.
class AllanDeviation {
 public:
  static constexpr std::size_t kOctaves = 26;
  void step(double value) noexcept;
  /// Marks a gap: the next value does not follow the previous one directly.
  void interrupt() noexcept;
  /// The deviation of averages over 2^octave samples; 0: too few samples.
  double at(std::size_t octave) const noexcept;
  std::uint64_t differences(std::size_t octave) const noexcept { return octaves_[octave].count; }

 private:
  struct Octave {
    double sum = 0, last = 0, squares = 0;
    std::uint64_t filled = 0, count = 0;  ///< averages of the octave below in `sum`; differences
    bool has_last = false;
  };
  std::array<Octave, kOctaves> octaves_;
};

/// The IMU's configured values; 0: not configured.
struct ImuExpectation {
  double rate_hz = 0;
  double gyroscope_density = 0, accelerometer_density = 0;  ///< per sqrt(Hz)
};

struct ImuResult {
  PacingResult pacing;
  double rest_s = 0;                                                        ///< total duration of standstill
  std::array<double, 3> gyroscope_rest_rad_s{}, accelerometer_rest_m_s2{};  ///< means at rest
  double gravity_m_s2 = 0;                                                  ///< length of accelerometer_rest_m_s2
  std::array<double, 3> gyroscope_density{}, accelerometer_density{};  ///< white noise by axis, 1/sqrt(Hz); 0: unknown
  std::array<double, 3> gyroscope_instability{}, accelerometer_instability{};  ///< least Allan deviation; 0: too short
  std::uint64_t not_finite = 0;
  int dead_axes = 0;  ///< axes whose value never changed
};

class ImuCheck {
 public:
  void step(const ImuSample& reading);
  ImuResult result(HostStamp now = {}) const;  ///< `now`: see Pacing

 private:
  static constexpr Span kWindow = Span::from_milliseconds(500);
  void end_window();

  Pacing pacing_;
  std::vector<ImuSample> window_;
  std::array<AllanDeviation, 6> allan_;
  std::array<double, 6> rest_sum_{};
  std::array<double, 6> least_{}, most_{};
  std::uint64_t rest_samples_ = 0, not_finite_ = 0, finite_ = 0;
  double rest_s_ = 0;
};

Findings findings_of(const ImuResult& result, const ImuExpectation& expected);

}  // namespace epiline
