#pragma once
// Checks every IMU sample before its use. Rules: docs/derivations/health.md.
#include <array>
#include <cstdint>

#include "estimator/inertial/spike_judge.h"
#include "pipeline/watch/burst_stamps.h"
#include "pipeline/watch/stamp_gate.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Known limits of the sensor. Samples at an unknown limit are recognised because they do not change.
struct ImuLimits {
  double gyroscope_rad_s = 1e9, accelerometer_m_s2 = 1e9;
};

struct ImuGateStats {
  std::uint64_t not_finite = 0, duplicate = 0, out_of_order = 0, suspect = 0, clock_steps = 0, saturated = 0, stuck = 0;
  std::uint64_t impossible = 0;  ///< values that no sensor, or not this one, can measure
  std::uint64_t spikes = 0;      ///< samples unlike their neighbours; passed on, and replaced when they are integrated
  std::uint64_t straightened = 0;  ///< stamped on arrival, in bursts
};

/// No clock, no heap. The same samples give the same verdicts.
class ImuGate {
 public:
  explicit ImuGate(const ImuLimits& limits) noexcept;

  /// Corrects the timestamp and sets `reading.reasons`. False: leave the sample out; its reasons are added to the next
  /// one.
  bool step(ImuSample& reading) noexcept;

  const ImuGateStats& stats() const noexcept { return stats_; }
  Span correction() const noexcept { return clock_.correction(); }
  double per_burst() const noexcept { return bursts_.per_burst(); }

 private:
  struct Axis {
    double limit = 0;  ///< readings of this size are no measurement
    double last = 0;
    int same = 0;           ///< readings in a row with this very value
    double repeats = 0.9;   ///< share of readings that repeat the one before: what rounding does
    double goes_on = 0.98;  ///< share of readings that go on along a line, level or not: what interpolation does
    double step = 0;        ///< from the last value but one that differed to the last
    double lines = 0;       ///< readings that goes_on was learnt from
    bool on_line = false;   ///< the last reading did go on so
  };

  static bool is_limit(const Axis& axis) noexcept;
  static void learn_rows(Axis& axis, double value) noexcept;
  bool refuse(std::uint64_t& counter) noexcept;
  bool impossible(const ImuSample& reading) const noexcept;
  bool spikes_persist(const ImuSample& reading) noexcept;
  bool in_order(ImuSample& reading) noexcept;
  bool straighten(ImuSample& reading) noexcept;
  bool saturated(const ImuSample& reading) noexcept;
  bool stuck(const ImuSample& reading) noexcept;

  BurstStamps bursts_;
  StampGate clock_;
  ReadingPeriod period_;
  SpikeJudge judge_;
  ImuGateStats stats_;
  std::array<Axis, 6> axes_{};
  ImuSample last_;
  HostStamp last_raw_;  ///< timestamp of `last_` as it came
  int same_ = 0;
  HostStamp same_since_;
  std::uint32_t pending_ = 0;
};

}  // namespace epiline
