#pragma once
// The highest straight line below points that come in with growing x: what remains of "host clock minus device clock"
// when every sample is late by a delay that is never negative. Derivation: docs/derivations/clock_sync.md
#include <cstddef>
#include <cstdint>

#include "platform/memory/fixed_vector.h"
#include "platform/time/clock.h"

namespace epiline {

/// y(x) = y_ns + slope (x - x_ns), nanoseconds.
struct ClockLine {
  std::int64_t x_ns = 0, y_ns = 0;
  double slope = 0;
  std::int64_t at(std::int64_t x) const noexcept {
    const double rise = slope * static_cast<double>(x - x_ns);
    return y_ns + static_cast<std::int64_t>(rise < 0 ? rise - 0.5 : rise + 0.5);
  }
};

/// The lower convex hull of points, and sums over all of them. A hull of more corners than there is room for loses the
/// flattest one: only a parabola of thousands of points has that many, and loses nanoseconds.
class LowerHull {
 public:
  struct Point {
    std::int64_t x_ns, y_ns;
  };

  /// `x_ns` greater than that of the point before.
  void add(std::int64_t x_ns, std::int64_t y_ns, std::int64_t residual_ns) noexcept;
  void clear() noexcept { *this = {}; }

  bool empty() const noexcept { return count_ == 0; }
  std::uint64_t count() const noexcept { return count_; }
  std::int64_t first_x_ns() const noexcept { return first_x_ns_; }
  std::int64_t newest_x_ns() const noexcept { return corners_.back().x_ns; }
  double mean_square_residual_ns2() const noexcept;
  std::int64_t residual_most_ns() const noexcept { return residual_most_ns_; }

  /// The line below all points whose distances to them have the least sum, its slope at most `slope_most` either way.
  /// Not empty. `free_slope` becomes the slope without that limit.
  ClockLine line(double slope_most, double& free_slope) const noexcept;

 private:
  static constexpr std::size_t kCorners = 64;

  void drop_flattest() noexcept;

  FixedVector<Point, kCorners> corners_;
  std::uint64_t count_ = 0;
  std::int64_t first_x_ns_ = 0;
  double x_sum_ns_ = 0, square_sum_ns2_ = 0;  ///< of x - first_x, and of the residuals' squares
  std::int64_t residual_most_ns_ = 0;
};

/// LowerHull over the newest points: at least those of one window, at most of two. Two hulls take turns.
class LowerEnvelope {
 public:
  struct Settings {
    Span window = Span::from_milliseconds(30'000);
    Span settle = Span::from_milliseconds(5'000);  ///< before, the slope's limit grows from 0 in proportion to time
    double slope_most = 200e-6;
  };
  explicit LowerEnvelope(const Settings& settings) noexcept : settings_(settings) {}

  /// As LowerHull::add().
  void add(std::int64_t x_ns, std::int64_t y_ns, std::int64_t residual_ns) noexcept;
  /// Forgets everything, and begins with the points of `hull`.
  void restart(const LowerHull& hull) noexcept;

  bool empty() const noexcept { return older_.empty(); }
  const ClockLine& line() const noexcept { return line_; }  ///< not empty
  const LowerHull& hull() const noexcept { return older_; }
  std::int64_t newest_x_ns() const noexcept { return older_.newest_x_ns(); }
  Span span() const noexcept;
  /// The window is long enough for a skew.
  bool settled() const noexcept { return span() >= settings_.settle; }
  /// The slope would be beyond its limit, and that is no accident of a short window.
  bool too_steep() const noexcept;
  /// That, or it had to be restarted again and again before half a window had passed.
  bool unusable() const noexcept { return too_steep() || hasty_restarts_ >= kHastyMost; }

 private:
  static constexpr int kHastyMost = 3;

  bool has_half_window() const noexcept { return span().ns >= settings_.window.ns / 2; }
  void fit() noexcept;

  Settings settings_;
  LowerHull older_, younger_;  ///< the younger one has a part of the older one's points
  ClockLine line_;
  double free_slope_ = 0;
  int hasty_restarts_ = 0;
};

}  // namespace epiline
