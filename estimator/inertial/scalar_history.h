#pragma once
#include <array>
#include <cstddef>

#include "platform/time/clock.h"

namespace epiline {

/// The readings of a sensor that measures one number, in time order, and their interpolation.
class ScalarHistory {
 public:
  struct Reading {
    HostStamp stamp;
    double value = 0;
  };
  /// Of the readings in some time.
  struct Mean {
    int count = 0;
    double value = 0;
  };
  /// Interpolates between readings that are at most `longest` apart.
  explicit ScalarHistory(Span longest) noexcept : longest_(longest) {}

  /// Adds a reading. False, and nothing is added: not finite, or not later than the previous one.
  bool push(HostStamp stamp, double value) noexcept;
  bool any() const noexcept { return pushed_ > 0; }
  /// The value at `stamp`, interpolated linearly. False: no reading before or after, or the two are too far apart in
  /// time.
  bool at(HostStamp stamp, double& value) const noexcept;
  Mean mean(HostStamp t0, HostStamp t1) const noexcept;
  /// The last reading but one less the mean of its neighbours; 0: there are no three.
  double bend() const noexcept { return count() < 3 ? 0 : back(1).value - 0.5 * (back(0).value + back(2).value); }
  /// Calls visit(from, to, span) for the pieces between readings that make up t0 to t1, in time order; `span`: between
  /// the two readings of which the piece is a part. False: there is none for some of the time; what was visited does
  /// not count then.
  template <class F>
  bool each_piece(HostStamp t0, HostStamp t1, F&& visit) const {
    Reading from{t0, 0};
    std::size_t i = after(t0);  // ages of readings: falling
    if (i >= count() || !at(t0, from.value)) return false;
    while (true) {
      const Span span = back(i).stamp - back(i + 1).stamp;
      if (span > longest_) return false;
      Reading to = back(i);
      if (to.stamp >= t1) {
        to.stamp = t1;
        if (!at(t1, to.value)) return false;
        visit(from, to, span);
        return true;
      }
      visit(from, to, span);
      from = to;
      if (i-- == 0) return false;
    }
  }

 private:
  static constexpr std::size_t kMost = 256;  // 2.5 s at 100 Hz
  std::size_t count() const { return pushed_ < kMost ? pushed_ : kMost; }
  const Reading& back(std::size_t i) const { return readings_[(pushed_ - 1 - i) % kMost]; }  ///< 0: the newest
  /// The oldest reading later than `stamp`, as an argument of back(); count(): there is none.
  std::size_t after(HostStamp stamp) const noexcept;

  Span longest_;
  std::array<Reading, kMost> readings_{};
  std::size_t pushed_ = 0;
};

}  // namespace epiline
