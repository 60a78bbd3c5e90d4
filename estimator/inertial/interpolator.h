#pragma once
// Predicts an IMU sample from the two before and the two after it. docs/derivations/imu.md, "Corrupt readings".
#include "estimator/geometry/types.h"

namespace epiline {

/// Learns for each axis how a reading follows from its neighbours: a smooth signal continues their curve, a vibration
/// at half the sampling rate changes sign between readings, and noise is best replaced by the mean. A pure object of
/// fixed size; the same work for every reading.
class Interpolator {
 public:
  using Values = Eigen::Array<double, 6, 1>;  ///< rad/s, then m/s^2
  struct Neighbours {
    Values before2, before1, after1, after2;
  };

  /// The most likely value between the four.
  Values between(const Neighbours& n) const;
  /// Learns from a sample that was measured between those four.
  void learn(const Neighbours& n, const Values& measured);
  /// Mean distance of the measured samples from between() so far.
  const Values& usual_error() const { return error_; }

 private:
  Values square_ = Values::Constant(kPrior), product_ = Values::Constant(kPrior * kLine);
  Values error_ = (Values() << 0.2, 0.2, 0.2, 2, 2, 2).finished();

  static constexpr double kPrior = 0.01;  // squares of rad/s and m/s^2, forgotten with the first readings
  static constexpr double kLine = 0.5;    // the weight that makes between() the line between the nearest two
};

}  // namespace epiline
