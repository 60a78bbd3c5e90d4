#pragma once
// The IMU's intervals between the window's frames: integrated, integrated anew, and doubted. Derivations:
// docs/derivations/imu.md; docs/derivations/health.md, "Forces that the images contradict".
#include "estimator/monitor/interval_watch.h"
#include "estimator/parts/common.h"

namespace epiline {

/// Without a reading to be trusted: too far to go on from (docs/derivations/health.md).
inline constexpr double kLongestUnknown_s = 0.25;
/// m/s^2, of a vehicle: while only images show how it moves, its way of flying says nothing.
inline constexpr double kAnyAcceleration = 30;

class Intervals {
 public:
  explicit Intervals(Common& common) : common_(common) {}
  bool is_silent(HostStamp from, HostStamp to) const;
  /// The interval between two frames. While the IMU is silent, only images show how the vehicle moves. False: there are
  /// no readings for it.
  bool integrate(const Slot& from, Slot& to) const;
  /// Those whose bias moved far from their linearisation point.
  void follow_biases();
  /// Those that ended at a reading, or shortly after one, whose verdict was not final yet.
  void follow_readings();
  /// All of them: the noise has changed.
  void weigh_anew();
  struct Doubt {
    bool forces = false, bias = false;
  };
  /// Forces of the last ones that the solved images contradict are doubted, the more so the second time, and the
  /// gyroscope's bias where they contradict the turn.
  Doubt doubt_contradicted();
  /// Of the newest one, solved: factor on the covariance, which believes the configured noise. `dt_s`: since the frame
  /// before.
  double widens(double dt_s);

 private:
  Slot* where_bias_stepped();
  void integrate_again(int k, const Vec3& b_a, const Vec3& b_g);
  void coast(const Slot& from, double T, Preintegration& interval) const;

  Common& common_;
  IntervalWatch watch_, turn_watch_;  ///< of all numbers, and of attitude and gyroscope bias; a reset forgets neither
};

}  // namespace epiline
