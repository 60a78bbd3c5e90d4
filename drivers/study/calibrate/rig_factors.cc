#include "drivers/study/calibrate/rig_factors.h"

#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"

namespace epiline {

namespace {

/// What accelerometers measure for being away from B's origin while B turns, and how that follows rate, angular
/// acceleration and, row i, the place of that of axis i.
struct Apart {
  Vec3 f_B;
  Mat3 by_omega_B, by_alpha_B, by_place_B;
};

Apart apart_from_origin(const Mat3& accelerometers_B, const Vec3& omega_B, const Vec3& alpha_B) {
  Apart apart;
  apart.by_place_B = skew(alpha_B) + skew(omega_B) * skew(omega_B);
  for (int i = 0; i < 3; ++i) {
    const Vec3 p_B = accelerometers_B.col(i);
    apart.f_B[i] = apart.by_place_B.row(i).dot(p_B);
    apart.by_omega_B.row(i) = omega_B[i] * p_B.transpose() - 2 * p_B[i] * omega_B.transpose();
    apart.by_omega_B(i, i) += omega_B.dot(p_B);
    apart.by_alpha_B.row(i) = -skew(p_B).row(i);
  }
  return apart;
}

}  // namespace

RigLayout::RigLayout(const RigState& state)
    : FitLayout(static_cast<int>(state.p_TB.size()), static_cast<int>(state.gyroscope_bias.size()),
                state.bias_interval_s / state.interval_s),
      columns(0, state.constants.lens.model) {
  columns = RigColumns(add_constants(columns.count()), state.constants.lens.model);
  corners = add_constants(3 * state.constants.shape.corners());
}

RigFactors::RigFactors(const RigState& state, const RigLayout& layout)
    : state_(state), layout_(layout), motion_(state.motion()), lens_(state.constants.lens) {}

RigFactors::Place RigFactors::place(double t_s) const {
  const SplinePlace at = spline_place(t_s + state_.lead_s, state_.interval_s, state_.p_TB.size());
  Place found{{}, cubic_weights(at.u), {}, {}};
  for (std::size_t i = 0; i < 4; ++i) found.knot[i] = layout_.knot[static_cast<std::size_t>(at.piece) + i];
  const double s = t_s / state_.bias_interval_s;
  const double m = std::clamp(std::floor(s), 0.0, static_cast<double>(layout_.bias.size() - 2));
  found.bias = {layout_.bias[static_cast<std::size_t>(m)], layout_.bias[static_cast<std::size_t>(m) + 1]};
  found.bias_weight = {1 - (s - m), s - m};
  return found;
}

void RigFactors::add_biases(const Place& at, int part, FitResidual& r) const {
  for (std::size_t i = 0; i < 2; ++i) r.add(at.bias[i] + part, -at.bias_weight[i] * Mat3::Identity());
}

FitResidual RigFactors::gyroscope(const RigReading& reading, double weight) const {
  const Place at = place(reading.t_s);
  const Motion m = motion_.at(reading.t_s);
  const Vec3 inverse_gain = state_.constants.gyroscope_gain.cwiseInverse();
  const Vec3 expected = inverse_gain.cwiseProduct(m.omega_B);
  FitResidual r(reading.w - motion_.gyroscope_bias(reading.t_s) - expected, weight);
  const Mat3 by_turn_rate = -(inverse_gain.asDiagonal() * m.R_WB.transpose());
  for (std::size_t i = 0; i < 4; ++i) r.add(at.knot[i] + 3, at.weights.first[i] / state_.interval_s * by_turn_rate);
  add_biases(at, 0, r);
  r.add(layout_.columns.gyroscope_gain, inverse_gain.cwiseProduct(expected).asDiagonal());
  return r;
}

FitResidual RigFactors::accelerometer(const RigReading& reading, double weight) const {
  const Place at = place(reading.t_s);
  const Motion m = motion_.at(reading.t_s);
  const Vec3 inverse_gain = state_.constants.accelerometer_gain.cwiseInverse(), f_T = m.a_WB - state_.constants.g_T;
  const Apart apart =
      apart_from_origin(state_.constants.accelerometers_B, m.omega_B, motion_.angular_acceleration(reading.t_s));
  const Vec3 f_B = m.R_WB.transpose() * f_T + apart.f_B;
  const Mat3 by_f_B = -Mat3(inverse_gain.asDiagonal()), by_f_T = by_f_B * m.R_WB.transpose(),
             by_rate = by_f_B * apart.by_omega_B * m.R_WB.transpose(),
             by_acceleration = by_f_B * apart.by_alpha_B * m.R_WB.transpose(), by_place = by_f_B * apart.by_place_B;
  const Vec3 expected = inverse_gain.cwiseProduct(f_B);
  FitResidual r(reading.a - motion_.accelerometer_bias(reading.t_s) - expected, weight);
  for (std::size_t i = 0; i < 4; ++i) {
    const double first = at.weights.first[i] / state_.interval_s,
                 second = at.weights.second[i] / (state_.interval_s * state_.interval_s);
    r.add(at.knot[i], second * by_f_T);
    r.add(at.knot[i] + 3, at.weights.value[i] * by_f_T * skew(f_T) + first * by_rate + second * by_acceleration);
  }
  add_biases(at, 3, r);
  Mat3 by_gravity = Mat3::Zero();
  by_gravity.leftCols<2>() = -state_.constants.g_T.norm() * by_f_T * state_.across_gravity();
  r.add(layout_.columns.gravity, by_gravity, 2);
  r.add(layout_.columns.accelerometer_gain, inverse_gain.cwiseProduct(expected).asDiagonal());
  Mat3 by_y = Mat3::Zero(), by_z = Mat3::Zero();  // the x axis' accelerometer moves against both
  by_y.row(0) = by_z.row(0) = -by_place.row(0);
  by_y.row(1) = by_place.row(1);
  by_z.row(2) = by_place.row(2);
  r.add(layout_.columns.accelerometer_y, by_y);
  r.add(layout_.columns.accelerometer_z, by_z);
  return r;
}

RigFactors::View RigFactors::look(double t_s) const {
  const double t = t_s + state_.constants.time_offset_s;
  const Place at = place(t);
  return {at.knot, at.weights.value, motion_.at(t)};
}

int RigFactors::column(const BoardCorner& corner) const {
  return layout_.corners + 3 * state_.constants.shape.index(corner);
}

bool RigFactors::corner(const View& view, const BoardCorner& corner, Vec2& e, CornerJacobian& J,
                        Mat23& by_corner) const {
  const Motion& m = view.motion;
  const Mat3 R_CB = state_.constants.R_BC.transpose(), R_CT = R_CB * m.R_WB.transpose();
  const Vec3 arm_T = state_.constants.shape.place(corner) - m.p_WB;
  const Vec3 p_C = R_CT * arm_T - R_CB * state_.constants.p_BC;
  Vec2 px;
  Mat23 by_point;
  LensJacobian by_lens;
  if (!lens_.project(p_C, px, by_point, by_lens)) return false;
  e = corner.px - px;
  const auto lens_count = by_lens.cols();
  J.resize(2, 6 + lens_count + 8);
  J.leftCols<3>() = -by_point * R_CT;
  J.middleCols<3>(3) = by_point * R_CT * skew(arm_T);
  J.middleCols(6, lens_count) = by_lens;
  J.middleCols<3>(6 + lens_count) = by_point * skew(p_C);
  J.middleCols<3>(9 + lens_count) = -by_point * R_CB;
  const Vec3 omega_T = m.R_WB * m.omega_B;
  J.col(12 + lens_count) = -by_point * R_CT * (m.v_WB + omega_T.cross(arm_T));
  by_corner = by_point * R_CT;
  J.col(13 + lens_count) = by_corner * (state_.constants.shape.scale * corner.p_T);  // by the logarithm of the scale
  return true;
}

}  // namespace epiline
