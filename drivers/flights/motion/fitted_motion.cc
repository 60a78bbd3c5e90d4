#include "drivers/flights/motion/fitted_motion.h"

#include <utility>

namespace epiline {

Polyline::Polyline(double interval_s, std::vector<Vec3> values) : interval_s_(interval_s), values_(std::move(values)) {}

Vec3 Polyline::at(double t_s) const {
  // a spline has as many pieces if it has two controls more
  const SplinePlace place = spline_place(t_s, interval_s_, values_.size() + 2);
  const Vec3* const from = values_.data() + place.piece;
  return from[0] + place.u * (from[1] - from[0]);
}

FittedMotion::FittedMotion(HostStamp begin, double duration_s, Splines splines, Biases biases)
    : begin_(begin), duration_s_(duration_s), splines_(std::move(splines)), biases_(std::move(biases)) {}

Motion FittedMotion::at(double t_s) const {
  const CubicSpline::Value p = splines_.position.at(t_s + splines_.lead_s);
  const RotationSpline::Value r = splines_.rotation.at(t_s + splines_.lead_s);
  return {p.value, p.first, p.second, r.R_WB, r.omega_B};
}

}  // namespace epiline
