#pragma once
// The way that a ground vehicle's wheels measure between two frames. Derivation: docs/derivations/wheel.md; test:
// tests/estimator/factors/wheel_test.cc.
#include <array>

#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// The way of the wheels' point by the states minus that read, m, in the body frame at the beginning; derivatives by
/// (p, theta) of both frames.
struct WheelResidual {
  Vec3 r;
  Eigen::Matrix<double, 3, 6> J_begin, J_end;
};
/// Between the states x of two frames.
void evaluate_wheel(const WheelModel& wheel, const Vec3& way, const std::array<NavState, 2>& x, WheelResidual& out);

/// Of interval k along its forward axis, m.
struct AlongWay {
  double moved = 0;  ///< by the states
  double read = 0;   ///< by the wheels
};
AlongWay along_way(const Window& window, int k);

/// What the ways of a run say of the scale that their speeds have in common, from the newest on. Each way is compared
/// with what the newer ones predict.
class WheelScale {
 public:
  using Shares = std::array<double, kMaxFrames>;  ///< of the intervals' ways moved less those read
  struct Innovation {
    double variance = 0;  ///< m^2
    Shares share{};
  };
  /// Of the next older interval k. `noise`: variance of its way read.
  Innovation add(int k, double moved, double noise) noexcept;
  /// Some time passes, in which the scale walks.
  void walk(double dt_s) noexcept;
  /// The scale of what is older is another one.
  void restart() noexcept { *this = {}; }
  /// 1 - the scale, as a sum of shares.
  const Shares& share() const noexcept { return share_; }
  double variance() const noexcept { return variance_; }

 private:
  static constexpr double kUnknown = 3;  // wheels of a wrong sign or unit fit in
  double variance_ = kUnknown * kUnknown;
  Shares share_{};
};

/// Finds the ways from which on older ones have another scale, and the scales, at the present states. Once before each
/// solve.
void find_slips(Window& window);

/// Returns the cost; null: the cost alone.
double add_wheel(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
