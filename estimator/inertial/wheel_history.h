#pragma once
#include <array>
#include <cstddef>

#include "platform/samples/samples.h"

namespace epiline {

/// Speeds in the order of time, and what they say of an instant between two of them.
class WheelHistory {
 public:
  /// False, and nothing is taken: not finite, or not later than the one before.
  bool push(const WheelSample& sample) noexcept;
  /// The speed at `stamp`, on the line between the speeds before and after. False: there is none before or after, or
  /// they are too far from each other.
  bool speed_at(HostStamp stamp, double& speed_m_s) const noexcept;

 private:
  static constexpr std::size_t kMost = 256;  // 2.5 s at 100 Hz
  static constexpr Span kLongest = Span::from_milliseconds(250);
  struct Reading {
    HostStamp stamp;
    double speed_m_s = 0;
  };
  const Reading& back(std::size_t i) const { return readings_[(pushed_ - 1 - i) % kMost]; }  ///< 0: the newest

  std::array<Reading, kMost> readings_{};
  std::size_t pushed_ = 0;
};

}  // namespace epiline
