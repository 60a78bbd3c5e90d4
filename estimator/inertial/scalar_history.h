#pragma once
#include <array>
#include <cstddef>

#include "platform/time/clock.h"

namespace epiline {

/// The readings of a sensor that measures one number, in time order, and their interpolation.
class ScalarHistory {
 public:
  /// Interpolates between readings that are at most `longest` apart.
  explicit ScalarHistory(Span longest) noexcept : longest_(longest) {}

  /// Adds a reading. False, and nothing is added: not finite, or not later than the previous one.
  bool push(HostStamp stamp, double value) noexcept;
  bool any() const noexcept { return pushed_ > 0; }
  /// The value at `stamp`, interpolated linearly. False: no reading before or after, or the two are too far apart in
  /// time.
  bool at(HostStamp stamp, double& value) const noexcept;

 private:
  static constexpr std::size_t kMost = 256;  // 2.5 s at 100 Hz
  struct Reading {
    HostStamp stamp;
    double value = 0;
  };
  const Reading& back(std::size_t i) const { return readings_[(pushed_ - 1 - i) % kMost]; }  ///< 0: the newest

  Span longest_;
  std::array<Reading, kMost> readings_{};
  std::size_t pushed_ = 0;
};

}  // namespace epiline
