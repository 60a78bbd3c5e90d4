#include "platform/math/statistics.h"

#include <algorithm>
#include <cmath>

namespace epiline {

double quantile(const std::vector<double>& sorted, double q) {
  const double position = q * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  const double share = position - static_cast<double>(below);
  return (1 - share) * sorted[below] + share * sorted[above];
}

Summary summarise(std::vector<double> values) {
  Summary s;
  s.count = values.size();
  if (values.empty()) return s;
  std::sort(values.begin(), values.end());
  double sum = 0, squares = 0;
  for (const double v : values) {
    sum += v;
    squares += v * v;
  }
  const auto n = static_cast<double>(values.size());
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  s.median = quantile(values, 0.5);
  s.p90 = quantile(values, 0.9);
  s.p95 = quantile(values, 0.95);
  s.p99 = quantile(values, 0.99);
  s.p999 = quantile(values, 0.999);
  s.max = values.back();
  return s;
}

}  // namespace epiline
