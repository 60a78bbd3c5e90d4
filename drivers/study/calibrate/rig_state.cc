#include "drivers/study/calibrate/rig_state.h"

#include <algorithm>
#include <cmath>

#include "drivers/study/calibrate/lens_columns.h"
#include "estimator/geometry/so3.h"

namespace epiline {

RigColumns::RigColumns(int first, CameraModel model)
    : begin(first),
      lens(begin),
      R_BC(lens + lens_columns(model)),
      p_BC(R_BC + 3),
      time_offset(p_BC + 3),
      board_size(time_offset + 1),
      gravity(board_size + 1),
      gyroscope_gain(gravity + 2),
      accelerometer_gain(gyroscope_gain + 3),
      accelerometer_y(accelerometer_gain + 3),
      accelerometer_z(accelerometer_y + 3),
      end(accelerometer_z + 3) {}

FittedMotion RigState::motion() const {
  return {begin,
          duration_s,
          {.position = {interval_s, p_TB}, .rotation = {interval_s, R_TB}, .lead_s = lead_s},
          {.gyroscope = {bias_interval_s, gyroscope_bias}, .accelerometer = {bias_interval_s, accelerometer_bias}}};
}

Eigen::Matrix<double, 3, 2> RigState::across_gravity() const {
  const Vec3 down = constants.g_T.normalized();
  const Vec3 first = down.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> across;
  across << first, down.cross(first);
  return across;
}

double RigState::move(const std::vector<double>& step, const std::vector<int>& knot, const std::vector<int>& bias,
                      const RigColumns& columns, int corners) {
  const auto part = [&](int column) -> Vec3 { return Eigen::Map<const Vec3>(step.data() + column); };
  double most = 0;
  for (std::size_t k = 0; k < p_TB.size(); ++k) {
    const Vec3 dp = part(knot[k]), turn_T = part(knot[k] + 3);
    p_TB[k] += dp;
    R_TB[k] = so3_normalised(so3_exp(turn_T) * R_TB[k]);
    most = std::max({most, dp.cwiseAbs().maxCoeff(), turn_T.cwiseAbs().maxCoeff()});
  }
  for (std::size_t m = 0; m < gyroscope_bias.size(); ++m) {
    gyroscope_bias[m] += part(bias[m]);
    accelerometer_bias[m] += part(bias[m] + 3);
  }
  const int lens_count = columns.R_BC - columns.lens;
  const LensStep values =
      lens_values(constants.lens) + Eigen::Map<const Eigen::VectorXd>(step.data() + columns.lens, lens_count);
  constants.lens = lens_with(constants.lens, values);
  const double length = constants.g_T.norm();
  const Vec3 g_T = constants.g_T + length * across_gravity() * Eigen::Map<const Vec2>(step.data() + columns.gravity);
  constants.g_T = length * g_T.normalized();
  constants.R_BC = so3_normalised(constants.R_BC * so3_exp(part(columns.R_BC)));
  constants.p_BC += part(columns.p_BC);
  constants.time_offset_s += step[static_cast<std::size_t>(columns.time_offset)];
  constexpr double kMostGrowth = 0.5;  // in one step, logarithmic: far from the size, steps are too long
  constants.shape.scale *=
      std::exp(std::clamp(step[static_cast<std::size_t>(columns.board_size)], -kMostGrowth, kMostGrowth));
  for (int i = 0; i < constants.shape.corners(); ++i) constants.shape.offset(i) += part(corners + 3 * i);
  constants.gyroscope_gain += part(columns.gyroscope_gain);
  constants.accelerometer_gain += part(columns.accelerometer_gain);
  const Vec3 dy_B = part(columns.accelerometer_y), dz_B = part(columns.accelerometer_z);
  constants.accelerometers_B.col(0) -= dy_B + dz_B;
  constants.accelerometers_B.col(1) += dy_B;
  constants.accelerometers_B.col(2) += dz_B;
  return most;
}

}  // namespace epiline
