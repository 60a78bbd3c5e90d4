#include "platform/time/lower_envelope.h"

#include <algorithm>
#include <cmath>

namespace epiline {

namespace {
/// How far b lies below the line from a to c; negative: above.
double depth_ns(const LowerHull::Point& a, const LowerHull::Point& b, const LowerHull::Point& c) noexcept {
  const double share = static_cast<double>(b.x_ns - a.x_ns) / static_cast<double>(c.x_ns - a.x_ns);
  return share * static_cast<double>(c.y_ns - a.y_ns) - static_cast<double>(b.y_ns - a.y_ns);
}
}  // namespace

void LowerHull::add(std::int64_t x_ns, std::int64_t y_ns, std::int64_t residual_ns) noexcept {
  if (empty()) first_x_ns_ = x_ns;
  const Point point{x_ns, y_ns};
  std::size_t n = corners_.size();
  while (n >= 2 && depth_ns(corners_[n - 2], corners_[n - 1], point) <= 0) --n;
  corners_.resize(n);
  if (corners_.full()) drop_flattest();
  corners_.push_back(point);
  ++count_;
  x_sum_ns_ += static_cast<double>(x_ns - first_x_ns_);
  const double residual = static_cast<double>(residual_ns);
  square_sum_ns2_ += residual * residual;
  residual_most_ns_ = std::max(residual_most_ns_, std::abs(residual_ns));
}

void LowerHull::drop_flattest() noexcept {
  std::size_t flattest = 1;
  double least_ns = depth_ns(corners_[0], corners_[1], corners_[2]);
  for (std::size_t i = 2; i + 1 < corners_.size(); ++i) {
    const double depth = depth_ns(corners_[i - 1], corners_[i], corners_[i + 1]);
    if (depth < least_ns) least_ns = depth, flattest = i;
  }
  std::copy(corners_.begin() + flattest + 1, corners_.end(), corners_.begin() + flattest);
  corners_.resize(corners_.size() - 1);
}

double LowerHull::mean_square_residual_ns2() const noexcept {
  return empty() ? 0 : square_sum_ns2_ / static_cast<double>(count_);
}

ClockLine LowerHull::line(double slope_most, double& free_slope) const noexcept {
  // The sum of distances depends on the line's height at the mean x alone: the hull's edge there is the highest.
  const std::int64_t mean_x_ns = first_x_ns_ + static_cast<std::int64_t>(x_sum_ns_ / static_cast<double>(count_));
  std::size_t left = 0;
  while (left + 2 < corners_.size() && corners_[left + 1].x_ns <= mean_x_ns) ++left;
  free_slope = 0;
  if (corners_.size() >= 2) {
    const Point &p = corners_[left], &q = corners_[left + 1];
    free_slope = static_cast<double>(q.y_ns - p.y_ns) / static_cast<double>(q.x_ns - p.x_ns);
  }
  const double slope = std::clamp(free_slope, -slope_most, slope_most);
  if (slope == free_slope) return {corners_[left].x_ns, corners_[left].y_ns, slope};
  // That height is a concave function of the slope, so the best slope allowed is the limit; its line touches one
  // corner.
  const Point* touched = corners_.begin();
  for (const Point& p : corners_) {
    const double rise = slope * static_cast<double>(p.x_ns - touched->x_ns);
    if (static_cast<double>(p.y_ns - touched->y_ns) < rise) touched = &p;
  }
  return {touched->x_ns, touched->y_ns, slope};
}

void LowerEnvelope::add(std::int64_t x_ns, std::int64_t y_ns, std::int64_t residual_ns) noexcept {
  if (!older_.empty() && x_ns - older_.first_x_ns() > 2 * settings_.window.ns) {
    older_ = younger_;
    younger_.clear();
    if (!older_.empty() && x_ns - older_.first_x_ns() > 2 * settings_.window.ns) older_.clear();
  }
  older_.add(x_ns, y_ns, residual_ns);
  if (x_ns - older_.first_x_ns() >= settings_.window.ns) younger_.add(x_ns, y_ns, residual_ns);
  fit();
  if (has_half_window()) hasty_restarts_ = 0;
}

void LowerEnvelope::restart(const LowerHull& hull) noexcept {
  hasty_restarts_ = has_half_window() ? 1 : hasty_restarts_ + 1;
  older_ = hull;
  younger_.clear();
  if (!older_.empty()) fit();
}

Span LowerEnvelope::span() const noexcept {
  return older_.empty() ? Span{} : Span{older_.newest_x_ns() - older_.first_x_ns()};
}

bool LowerEnvelope::too_steep() const noexcept {
  return has_half_window() && std::abs(free_slope_) > settings_.slope_most;
}

void LowerEnvelope::fit() noexcept {
  const double share = static_cast<double>(span().ns) / static_cast<double>(settings_.settle.ns);
  line_ = older_.line(settings_.slope_most * std::min(1.0, share), free_slope_);
}

}  // namespace epiline
