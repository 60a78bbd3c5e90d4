#pragma once
// How far the body turned between two instants, from the gyroscope alone.
#include <array>
#include <cstddef>

#include "estimator/geometry/types.h"
#include "estimator/inertial/spike_judge.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Remembers the last readings of the gyroscope. No allocation.
class GyroRotation {
 public:
  static constexpr std::size_t kCapacity = 4096;  ///< readings kept: 2 s of the fastest IMUs

  /// Readings in time order; an impossible one (is_impossible), or one not later than the last, is left out. In place
  /// of a corrupt one stands the line between its neighbours, as in ImuHistory.
  void add(const ImuSample& sample) noexcept;

  /// R_B0B1, the attitude of the body at `to` seen from the body at `from`; readings are taken as linear in between.
  /// The last reading holds for as long as the one before it did; the rest of the interval after it, and the part
  /// before the first, count as no turn. Without two readings the result is the identity.
  Mat3 between(HostStamp from, HostStamp to, const Vec3& bias_rad_s) const noexcept;

 private:
  struct Reading {
    HostStamp stamp;
    Vec3 rate_rad_s;
    bool suspect = false;
  };
  const Reading& at(std::size_t i) const { return readings_[(first_ + i) % kCapacity]; }
  Reading& at(std::size_t i) { return readings_[(first_ + i) % kCapacity]; }
  void settle(const SpikeJudge::Verdict& verdict) noexcept;
  Vec3 rate(std::size_t i) const;
  /// The rate at an instant between readings i and i + 1.
  Vec3 rate_between(std::size_t i, HostStamp stamp) const;

  std::array<Reading, kCapacity> readings_{};
  std::size_t first_ = 0, size_ = 0;
  ReadingPeriod period_;
  SpikeJudge judge_;
};

}  // namespace epiline
