#pragma once
// Looks at every reading of the IMU before anybody uses it. docs/derivations/health.md has the rules.
#include <array>
#include <cstdint>

#include "pipeline/watch/stamp_gate.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Limits of the sensor, as far as they are known. Readings at an unknown one show by not changing.
struct ImuLimits {
  double gyroscope_rad_s = 1e9, accelerometer_m_s2 = 1e9;
};

struct ImuGateStats {
  std::uint64_t not_finite = 0, duplicate = 0, out_of_order = 0, suspect = 0, clock_steps = 0, saturated = 0, stuck = 0;
};

/// A pure object: no clock, no heap. The same readings give the same verdicts.
class ImuGate {
 public:
  explicit ImuGate(const ImuLimits& limits) noexcept;

  /// Corrects the stamp and writes what is wrong into `reading.reasons`. False: leave it out; what was wrong is told
  /// with the next one.
  bool step(ImuSample& reading) noexcept;

  const ImuGateStats& stats() const noexcept { return stats_; }
  Span correction() const noexcept { return clock_.correction(); }

 private:
  bool refuse(std::uint64_t& counter) noexcept;
  bool in_order(ImuSample& reading) noexcept;
  bool saturated(const ImuSample& reading) noexcept;
  bool stuck(const ImuSample& reading) noexcept;

  StampGate clock_;
  ImuGateStats stats_;
  struct Axis {
    double limit = 0;  ///< readings of this size are no measurement
    double last = 0;
    int same = 0;          ///< readings in a row with this very value
    double repeats = 0.9;  ///< share of readings that repeat the one before: what rounding does
  };
  std::array<Axis, 6> axes_{};
  ImuSample last_;
  int same_ = 0;
  HostStamp same_since_;
  std::uint32_t pending_ = 0;
};

}  // namespace epiline
