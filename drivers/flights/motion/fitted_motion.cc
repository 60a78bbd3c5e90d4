#include "drivers/flights/motion/fitted_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace epiline {

Polyline::Polyline(double interval_s, std::vector<Vec3> values) : interval_s_(interval_s), values_(std::move(values)) {}

Vec3 Polyline::at(double t_s) const {
  const double s = t_s / interval_s_;
  const double piece = std::clamp(std::floor(s), 0.0, static_cast<double>(values_.size() - 2));
  const auto i = static_cast<std::size_t>(piece);
  return values_[i] + (s - piece) * (values_[i + 1] - values_[i]);
}

FittedMotion::FittedMotion(HostStamp begin, double duration_s, Splines splines, Biases biases)
    : begin_(begin), duration_s_(duration_s), splines_(std::move(splines)), biases_(std::move(biases)) {}

Motion FittedMotion::at(double t_s) const {
  const CubicSpline::Value p = splines_.position.at(t_s + splines_.lead_s);
  const RotationSpline::Value r = splines_.rotation.at(t_s + splines_.lead_s);
  return {p.value, p.first, p.second, r.R_WB, r.omega_B};
}

}  // namespace epiline
