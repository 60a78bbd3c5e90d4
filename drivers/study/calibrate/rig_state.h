#pragma once
// The unknowns of a calibration: the rig's constants, and the motion of the IMU before the board as splines.
#include <vector>

#include "drivers/flights/motion/fitted_motion.h"
#include "drivers/study/calibrate/board_shape.h"
#include "estimator/geometry/camera.h"
#include "estimator/inertial/imu_noise.h"

namespace epiline {

/// T: the board's frame. B: the IMU; its origin is the middle of the three accelerometers.
struct RigConstants {
  CameraParameters lens;
  Mat3 R_BC = Mat3::Identity();
  Vec3 p_BC = Vec3::Zero();   ///< m
  double time_offset_s = 0;   ///< t_IMU = t_image + time_offset
  BoardShape shape;           ///< its scale included
  Vec3 g_T = Vec3(0, 0, -1);  ///< gravity, m/s^2; its length is known
  /// What a reading without its bias is multiplied by to be true, per axis.
  Vec3 gyroscope_gain = Vec3::Ones(), accelerometer_gain = Vec3::Ones();
  Mat3 accelerometers_B = Mat3::Zero();  ///< column i: where that of axis i is, m; their sum is zero
};

/// Columns of the constants in the equations, in this order from `begin` on; the corners of the board come behind.
struct RigColumns {
  explicit RigColumns(int begin, CameraModel model);
  int begin, lens, R_BC, p_BC, time_offset, board_size, gravity, gyroscope_gain, accelerometer_gain;
  int accelerometer_y, accelerometer_z;  ///< places of these two accelerometers
  int end;
  int count() const { return end - begin; }
};

struct RigState {
  RigConstants constants;
  HostStamp begin;  ///< of the splines' time
  double duration_s = 0;
  double interval_s = 0, lead_s = 0;  ///< between knots of the motion; the splines' time at `begin`
  double bias_interval_s = 0;
  std::vector<Vec3> p_TB;  ///< knots
  std::vector<Mat3> R_TB;
  std::vector<Vec3> gyroscope_bias, accelerometer_bias;  ///< knots

  FittedMotion motion() const;
  /// Two directions across gravity, in which its estimate moves.
  Eigen::Matrix<double, 3, 2> across_gravity() const;
  /// Adds a step of the equations. Returns the largest move of a knot, m or rad.
  double move(const std::vector<double>& step, const std::vector<int>& knot, const std::vector<int>& bias,
              const RigColumns& columns, int corners);
};

}  // namespace epiline
