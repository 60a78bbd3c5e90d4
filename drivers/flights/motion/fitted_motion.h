#pragma once
// The motion of a recorded flight as a smooth function of time, with the biases its IMU had.
#include <vector>

#include "drivers/flights/motion/motion.h"
#include "drivers/flights/motion/spline.h"
#include "platform/time/clock.h"

namespace epiline {

/// Values at even distances, straight lines between.
class Polyline {
 public:
  Polyline() = default;
  /// `values`: two at least, the first at time 0.
  Polyline(double interval_s, std::vector<Vec3> values);
  /// Outside, the last line is continued.
  Vec3 at(double t_s) const;

 private:
  double interval_s_ = 1;
  std::vector<Vec3> values_;
};

class FittedMotion final : public MotionModel {
 public:
  struct Splines {
    CubicSpline position;
    RotationSpline rotation;
    double lead_s = 0;  ///< their time at t_s = 0
  };
  struct Biases {
    Polyline gyroscope, accelerometer;  ///< rad/s, m/s^2, in B
  };
  FittedMotion() = default;
  FittedMotion(HostStamp begin, double duration_s, Splines splines, Biases biases);
  /// `t_s` in [0, duration_s()].
  Motion at(double t_s) const override;
  /// rad/s^2, in B.
  Vec3 angular_acceleration(double t_s) const { return splines_.rotation.at(t_s + splines_.lead_s).alpha_B; }
  double duration_s() const override { return duration_s_; }
  /// The IMU's time at t_s = 0.
  HostStamp begin() const { return begin_; }
  double seconds(HostStamp stamp) const { return (stamp - begin_).seconds(); }
  Vec3 gyroscope_bias(double t_s) const { return biases_.gyroscope.at(t_s); }
  Vec3 accelerometer_bias(double t_s) const { return biases_.accelerometer.at(t_s); }

 private:
  HostStamp begin_;
  double duration_s_ = 0;
  Splines splines_;
  Biases biases_;
};

}  // namespace epiline
