// Derivation: docs/derivations/clock_sync.md
#include "platform/time/lower_envelope.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

namespace epiline {
namespace {

using Points = std::vector<LowerHull::Point>;

double mean_x(const Points& points) {
  double sum = 0;
  for (const auto& p : points) sum += static_cast<double>(p.x_ns - points[0].x_ns);
  return sum / static_cast<double>(points.size());
}

/// The linear program itself, without a hull: of the slopes through two points, and the limits, the one whose line
/// below all points is highest at the mean x. Heights are relative to the first point.
double best_height(const Points& points, double slope_most) {
  const auto x = [&](const auto& p) { return static_cast<double>(p.x_ns - points[0].x_ns); };
  const auto y = [&](const auto& p) { return static_cast<double>(p.y_ns - points[0].y_ns); };
  std::vector<double> slopes{0, slope_most, -slope_most};
  for (const auto& p : points)
    for (const auto& q : points)
      if (p.x_ns < q.x_ns) slopes.push_back(std::clamp((y(q) - y(p)) / (x(q) - x(p)), -slope_most, slope_most));
  double best = -std::numeric_limits<double>::infinity();
  for (const double slope : slopes) {
    double height = std::numeric_limits<double>::infinity();
    for (const auto& p : points) height = std::min(height, y(p) + slope * (mean_x(points) - x(p)));
    best = std::max(best, height);
  }
  return best;
}

void expect_best_line(const ClockLine& line, const Points& points, double slope_most) {
  for (const auto& p : points) RC_ASSERT(line.at(p.x_ns) <= p.y_ns + 1);
  RC_ASSERT(std::abs(line.slope) <= slope_most);
  const double at_mean = static_cast<double>(line.y_ns - points[0].y_ns) +
                         line.slope * (static_cast<double>(points[0].x_ns - line.x_ns) + mean_x(points));
  RC_ASSERT(std::abs(at_mean - best_height(points, slope_most)) < 1.0);
}

Points any_points(std::int64_t step_most_ns) {
  const std::int64_t height_ns = *rc::gen::element<std::int64_t>(10, 1000, 100'000, 10'000'000);
  const auto steps = *rc::gen::nonEmpty(
      rc::gen::container<std::vector<std::int64_t>>(rc::gen::inRange<std::int64_t>(1, step_most_ns)));
  Points points;
  std::int64_t x = *rc::gen::inRange<std::int64_t>(-1'000'000'000'000'000'000, 1'000'000'000'000'000'000);
  for (const std::int64_t step : steps)
    points.push_back({x += step, 2'000'000'000'000'000'000 + *rc::gen::inRange<std::int64_t>(-height_ns, height_ns)});
  return points;
}

RC_GTEST_PROP(LowerEnvelope, IsTheHighestLineBelowAllPoints, ()) {
  const Points points = any_points(10'000'000);
  LowerEnvelope envelope({Span{1'000'000'000'000}, Span{1}, 200e-6});
  for (const auto& p : points) envelope.add(p.x_ns, p.y_ns, 0);
  expect_best_line(envelope.line(), points, points.size() > 1 ? 200e-6 : 0);
}

RC_GTEST_PROP(LowerEnvelope, ForgetsWhatIsOlderThanTwoWindowsAndNothingOfTheLast, ()) {
  const Span window{*rc::gen::inRange<std::int64_t>(1'000'000, 100'000'000)};
  LowerEnvelope envelope({window, Span{1}, 200e-6});
  Points points;
  for (const auto& p : any_points(40'000'000)) {
    points.push_back(p);
    envelope.add(p.x_ns, p.y_ns, 0);
    const std::int64_t first = envelope.hull().first_x_ns();
    RC_ASSERT(first >= p.x_ns - 2 * window.ns);
    const auto old =
        std::find_if(points.begin(), points.end(), [&](const auto& q) { return q.x_ns >= p.x_ns - window.ns; });
    RC_ASSERT(first <= old->x_ns);
    points.erase(points.begin(),
                 std::find_if(points.begin(), points.end(), [&](const auto& q) { return q.x_ns >= first; }));
    RC_ASSERT(envelope.hull().count() == points.size());
    expect_best_line(envelope.line(), points, points.size() > 1 ? 200e-6 : 0);
  }
}

TEST(LowerEnvelope, AParabolaOfThousandsOfCornersLosesNanoseconds) {
  LowerEnvelope envelope({Span::from_milliseconds(60'000), Span{1}, 200e-6});
  Points points;
  for (std::int64_t i = 0; i <= 12'000; ++i) {
    const double t = static_cast<double>(i) * 5e-3;
    points.push_back({i * 5'000'000, static_cast<std::int64_t>(0.5 * 1e9 * 1e-6 / 60 * t * t)});  // 1 ppm in a minute
    envelope.add(points.back().x_ns, points.back().y_ns, 0);
  }
  std::int64_t above = 0;
  for (const auto& p : points) above = std::max(above, envelope.line().at(p.x_ns) - p.y_ns);
  EXPECT_LT(above, 10) << "ns above a sample";
}

TEST(LowerEnvelope, TheSlopeIsHeldBackUntilTheWindowIsLongEnough) {
  LowerEnvelope envelope({Span::from_milliseconds(30'000), Span::from_milliseconds(5'000), 200e-6});
  envelope.add(0, 0, 0);
  envelope.add(10'000'000, -1'000'000, 0);  // the first sample came a millisecond late: no slope
  EXPECT_NEAR(envelope.line().slope, -200e-6 * 0.01 / 5, 1e-12);
  EXPECT_EQ(envelope.line().at(10'000'000), -1'000'000);
  EXPECT_FALSE(envelope.settled());
}

// A short window gives any slope; one of half its length does not.
TEST(LowerEnvelope, IsTooSteepFromHalfAWindowOn) {
  LowerEnvelope::Settings settings;
  settings.window = Span::from_milliseconds(2'000);
  settings.settle = Span::from_milliseconds(500);
  LowerEnvelope envelope(settings);
  for (std::int64_t ms = 0; ms <= 1'500; ms += 10) {
    envelope.add(ms * 1'000'000, ms * 1'000, 0);  // 1000 ppm
    EXPECT_EQ(envelope.too_steep(), ms >= 1'000) << ms;
    EXPECT_EQ(envelope.unusable(), ms >= 1'000) << ms;
  }
}

}  // namespace
}  // namespace epiline
