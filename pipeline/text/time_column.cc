#include "pipeline/text/time_column.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "pipeline/text/table.h"

namespace epiline {

namespace {

/// No sensor is faster. One more than a thousand times slower counts as one in nanoseconds, which nearly all lists
/// have.
constexpr double kFastestSensor_hz = 4e3, kFastestImu_hz = 25e3;

std::int64_t power_of_ten(int digits) {
  std::int64_t power = 1;
  for (int i = 0; i < digits; ++i) power *= 10;
  return power;
}

const char* expected_of(TimeColumn column) {
  if (column == TimeColumn::kSeconds) return "a time in seconds";
  if (column == TimeColumn::kNanoseconds) return "a time in integer nanoseconds";
  return "a time (integer nanoseconds; or microseconds, milliseconds, seconds)";
}

/// Steps between the times, over their middle half; 0: not known.
double mean_step(std::vector<double> times) {
  std::erase_if(times, [](double t) { return !std::isfinite(t); });
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());  // the points of one image have one time
  if (times.size() < 2) return 0;
  const std::size_t first = times.size() / 4, last = times.size() - 1 - first;
  return (times[last] - times[first]) / static_cast<double>(last - first);
}

}  // namespace

bool parse_time(std::string_view field, const TimeUnit& unit, std::int64_t& ns) {
  const std::int64_t whole_unit = power_of_ten(unit.digits),
                     most = kLargestTime_ns / whole_unit - (unit.digits > 0 ? 1 : 0);
  const auto digits = static_cast<std::size_t>(unit.digits);
  const bool negative = !field.empty() && field[0] == '-';
  const std::size_t point = std::min(field.find('.'), field.size());
  const std::string_view fraction = field.substr(std::min(point + 1, field.size()));
  std::int64_t whole = 0;
  const bool plain =
      parse_number(field.substr(0, point), whole) && fraction.find_first_not_of("0123456789") == std::string_view::npos;
  if (plain) {
    std::int64_t part = 0;
    for (std::size_t i = 0; i < digits; ++i) part = part * 10 + (i < fraction.size() ? fraction[i] - '0' : 0);
    if (fraction.size() > digits && fraction[digits] >= '5') ++part;
    if (whole < -most || whole > most - (unit.digits > 0 ? 0 : part)) return false;
    ns = whole * whole_unit + (negative ? -part : part);
    return true;
  }
  double value = 0;
  if (!parse_number(field, value) || !(std::abs(value) < static_cast<double>(most))) return false;
  ns = static_cast<std::int64_t>(std::llround(value * static_cast<double>(whole_unit)));
  return true;
}

TimeUnit unit_of(std::vector<double> times, TimeColumn column) {
  const double step = mean_step(std::move(times)),
               fastest_hz = column == TimeColumn::kImu ? kFastestImu_hz : kFastestSensor_hz;
  for (const TimeUnit& unit : {kInNanoseconds, kInMicroseconds, kInMilliseconds})
    if (step * static_cast<double>(power_of_ten(unit.digits)) * fastest_hz >= 1e9) return unit;
  return step > 0 ? kInSeconds : kInNanoseconds;
}

Result<std::vector<std::int64_t>> TimeFields::parse(TimeColumn column, const std::string& file,
                                                    std::vector<std::string>& notes) const {
  TimeUnit unit = column == TimeColumn::kSeconds ? kInSeconds : kInNanoseconds;
  if (column == TimeColumn::kSensor || column == TimeColumn::kImu) {
    std::vector<double> times;
    times.reserve(fields_.size());
    for (const std::string_view field : fields_)
      if (double value = 0; parse_number(field, value)) times.push_back(value);
    unit = unit_of(times, column);
    if (unit.digits > 0) notes.push_back(fmt::format("{}: the times are read as {}", file, unit.name));
  }
  std::vector<std::int64_t> ns(fields_.size());
  for (std::size_t i = 0; i < fields_.size(); ++i) {
    const bool good = column == TimeColumn::kNanoseconds
                          ? parse_number(fields_[i], ns[i]) && ns[i] >= -kLargestTime_ns && ns[i] <= kLargestTime_ns
                          : parse_time(fields_[i], unit, ns[i]);
    if (!good) return Error{ErrorKind::kUsage, file, lines_[i], quoted(fields_[i]), expected_of(column)};
  }
  return ns;
}

std::vector<std::size_t> order_of_time(const std::vector<std::int64_t>& ns, const std::string& file,
                                       std::vector<std::string>& notes) {
  constexpr std::size_t kFew = 5;  // one in so many may have a wrong stamp
  std::size_t behind = 0;
  std::int64_t latest = std::numeric_limits<std::int64_t>::min();
  for (const std::int64_t t : ns) {
    behind += t < latest;
    latest = std::max(latest, t);
  }
  if (behind * kFew <= ns.size()) return {};
  std::vector<std::size_t> order(ns.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return ns[a] < ns[b]; });
  notes.push_back(fmt::format("{}: {} of {} lines are not in the order of time: sorted", file, behind, ns.size()));
  return order;
}

}  // namespace epiline
