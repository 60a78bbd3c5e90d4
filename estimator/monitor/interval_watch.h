#pragma once
// By how much an interval of the IMU contradicts the images. docs/derivations/health.md, "Forces that the images
// contradict".
#include <algorithm>

namespace epiline {

/// Compares squared residuals of intervals, once they are solved, with the usual one of this IMU on this vehicle.
class IntervalWatch {
 public:
  /// Of the newest interval; `dt_s` since the one before.
  void add(double chi2, double dt_s) noexcept {
    usual_ += std::min(1.0, dt_s / kMemory_s) * (std::min(chi2, kStillContradicted * usual()) - usual_);
  }
  /// `follows`: the interval before it is contradicted, too.
  bool contradicted(double chi2, bool follows) const noexcept {
    return times_usual(chi2) > (follows ? kStillContradicted : kContradicted);
  }
  /// `mean`: of the last four.
  bool persists(double mean) const noexcept { return times_usual(mean) > kPersists; }
  /// Factor on a covariance, which believes the configured noise.
  double widens(double chi2) const noexcept { return std::max(1.0, times_usual(chi2)); }

 private:
  double times_usual(double chi2) const noexcept { return chi2 / usual(); }
  double usual() const noexcept { return std::max(usual_, kLeastUsual); }
  // Of the newest interval, whose states follow the noise: mean 0.25 to 0.49 on nineteen right flights, at
  // most 4.6; 1.5 and 12 on recorded MH_01, which is handled on the ground. In a lift it is 10 to 35 half a second
  // after it has begun to move.
  static constexpr double kLeastUsual = 0.25, kMemory_s = 5;
  static constexpr double kContradicted = 15, kStillContradicted = 5;
  static constexpr double kPersists = 6;  // at most 4.8 on MH_01 and simulated hovers
  double usual_ = kLeastUsual;
};

}  // namespace epiline
