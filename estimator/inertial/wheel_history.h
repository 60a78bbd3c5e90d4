#pragma once
#include <array>
#include <cstddef>

#include "platform/samples/samples.h"

namespace epiline {

/// Wheel speeds in time order, and their interpolation.
class WheelHistory {
 public:
  /// Adds a speed. False, and nothing is added: not finite, or not later than the previous one.
  bool push(const WheelSample& sample) noexcept;
  /// The speed at `stamp`, interpolated linearly. False: no speed before or after, or the two are too far apart in
  /// time.
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
