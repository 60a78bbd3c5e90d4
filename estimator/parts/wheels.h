#pragma once
// The wheels of a ground vehicle, from their speeds to ways in the window. Derivation: docs/derivations/wheel.md.
#include <optional>

#include "estimator/inertial/scalar_history.h"
#include "estimator/monitor/wheel_watch.h"
#include "estimator/parts/common.h"

namespace epiline {

/// What the wheels read of the newest frame.
enum class WheelMotion : std::uint8_t { kUnknown, kStand, kTurn };

class Wheels {
 public:
  explicit Wheels(Common& common) : common_(common), watch_(common.config.wheel.scale_sigma) {}
  /// False: it is left out.
  bool add(const WheelSample& sample);
  /// Gives their way to intervals with speeds around all of their time, once; the last of these speeds may come after
  /// the frame.
  void attach();
  void find_slips();
  /// Compares with what was just solved.
  void watch();
  const WheelWatch& words() const { return watch_; }
  /// Wheels that are known not to turn with the vehicle say nothing.
  WheelMotion motion() const;
  /// The speed of B along the vehicle's forward axis at a frame, and its information.
  struct Speed {
    double m_s, information;
  };
  std::optional<Speed> speed_of(const Slot& frame) const;

 private:
  void learn_noise();

  Common& common_;
  ScalarHistory readings_{Span::from_milliseconds(250)};
  WheelWatch watch_;
  double variance_ = 0;  ///< of the speeds' noise, as they scatter
};

}  // namespace epiline
