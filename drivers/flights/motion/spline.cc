#include "drivers/flights/motion/spline.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/geometry/so3.h"

namespace epiline {

CubicWeights cubic_weights(double u) {
  const double u2 = u * u, u3 = u2 * u;
  return {
      .value = {(1 - 3 * u + 3 * u2 - u3) / 6, (4 - 6 * u2 + 3 * u3) / 6, (1 + 3 * u + 3 * u2 - 3 * u3) / 6, u3 / 6},
      .first = {(-3 + 6 * u - 3 * u2) / 6, (-12 * u + 9 * u2) / 6, (3 + 6 * u - 9 * u2) / 6, 3 * u2 / 6},
      .second = {1 - u, -2 + 3 * u, 1 - 3 * u, u}};
}

SplinePlace spline_place(double t_s, double interval_s, std::size_t controls) {
  const double s = t_s / interval_s;
  const double piece = std::clamp(std::floor(s), 0.0, static_cast<double>(controls - 4));
  return {static_cast<int>(piece), s - piece};
}

CubicSpline::CubicSpline(double interval_s, std::vector<Vec3> controls)
    : interval_s_(interval_s), controls_(std::move(controls)) {}

CubicSpline::Value CubicSpline::at(double t_s) const {
  const SplinePlace place = spline_place(t_s, interval_s_, controls_.size());
  const CubicWeights w = cubic_weights(place.u);
  const Vec3* c = controls_.data() + place.piece;
  Value v{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  for (std::size_t i = 0; i < 4; ++i) {
    v.value += w.value[i] * c[i];
    v.first += w.first[i] / interval_s_ * c[i];
    v.second += w.second[i] / (interval_s_ * interval_s_) * c[i];
  }
  return v;
}

RotationSpline::RotationSpline(double interval_s, std::vector<Mat3> controls)
    : interval_s_(interval_s), controls_(std::move(controls)) {
  for (std::size_t i = 0; i + 1 < controls_.size(); ++i)
    steps_.push_back(so3_log(controls_[i].transpose() * controls_[i + 1]));
}

RotationSpline::Value RotationSpline::at(double t_s) const {
  const SplinePlace place = spline_place(t_s, interval_s_, controls_.size());
  const CubicWeights w = cubic_weights(place.u);
  Value v{controls_[static_cast<std::size_t>(place.piece)], Vec3::Zero(), Vec3::Zero()};
  double sum = 1 - w.value[0], first = -w.first[0], second = -w.second[0];
  for (std::size_t j = 1; j < 4; ++j) {
    const Vec3& d = steps_[static_cast<std::size_t>(place.piece) + j - 1];
    const Mat3 turn = so3_exp(sum * d);
    v.R_WB = v.R_WB * turn;
    const Vec3 rate = first / interval_s_ * d, omega_B = turn.transpose() * v.omega_B;
    v.alpha_B = turn.transpose() * v.alpha_B + omega_B.cross(rate) + second / (interval_s_ * interval_s_) * d;
    v.omega_B = omega_B + rate;
    sum -= w.value[j];
    first -= w.first[j];
    second -= w.second[j];
  }
  return v;
}

}  // namespace epiline
