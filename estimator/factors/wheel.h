#pragma once
// The forward speed that a ground vehicle's wheels tell, as a residual of one frame. Derivation:
// docs/derivations/wheel.md; test: tests/estimator/factors/wheel_test.cc.
#include <array>
#include <cstddef>

#include "estimator/estimator.h"
#include "estimator/window/state.h"
#include "platform/samples/samples.h"

namespace epiline {

using Row15 = Eigen::Matrix<double, 1, 15>;

/// r = speed of the wheels' point along the forward axis, by the state, minus the measured one, m/s. J: d r / d delta,
/// tangent order (p, theta, v, b_a, b_g). Robust, both in units of the deviation: `weight` multiplies J'J and J'r,
/// `cost` is what the kernel makes of r squared.
struct WheelResidual {
  double r = 0, weight = 0, cost = 0;
  Row15 J = Row15::Zero();
};

/// Residual at x. `omega`: angular rate of the body at that instant, bias not removed. The Jacobian takes rotation and
/// velocity from the linearisation point l; pass x itself for the plain one.
void evaluate_wheel(const WheelModel& wheel, double speed_m_s, const Vec3& omega, const NavState& x, const NavState& l,
                    WheelResidual& out);

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
