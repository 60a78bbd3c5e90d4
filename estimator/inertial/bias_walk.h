#pragma once
// How much faster than configured a bias walks. Derivation: docs/derivations/imu.md#walk-of-the-biases; test:
// tests/estimator/inertial/bias_walk_test.cc.
#include <algorithm>
#include <cmath>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Compares the estimate with what was known of it two seconds before. A sensor that warms up moves farther than that
/// and its walk allow; then the walk grows, until it is as large as what is seen.
class BiasWalk {
 public:
  explicit BiasWalk(double most) noexcept : most_squared_(most * most) {}
  /// `b` with covariance `P`, the random walk's density as assumed now. True if that turned out to be far too little.
  bool add(HostStamp now, const Vec3& b, const Mat3& P, double density) noexcept {
    const double T = (now - then_).seconds();
    if (known_ && T < kApart_s) return false;
    const double before = squared_;
    if (known_ && T < 2 * kApart_s) {
      const Vec3 variance = P_.diagonal().array() + density * density * T;
      const double seen = (b - b_).cwiseAbs2().cwiseQuotient(variance).sum() / 3;
      squared_ = std::clamp(squared_ * std::max(seen, kFall), 1.0, most_squared_);
    }
    known_ = true;
    then_ = now;
    b_ = b;
    P_ = P;
    return squared_ > kFar * before;
  }
  /// The next estimate is another flight's; the factor stays.
  void restart() noexcept { known_ = false; }
  /// Of the configured random walk, at least 1.
  double factor() const noexcept { return std::sqrt(squared_); }

 private:
  static constexpr double kApart_s = 2;
  static constexpr double kFar = 2;
  static constexpr double kFall = 0.8;  // of the variance, each time
  double most_squared_, squared_ = 1;
  bool known_ = false;
  HostStamp then_;
  Vec3 b_ = Vec3::Zero();
  Mat3 P_ = Mat3::Zero();
};

}  // namespace epiline
