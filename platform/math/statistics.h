#pragma once
#include <cstddef>
#include <vector>

namespace epiline {

/// What a set of figures looks like. All zero where the set is empty.
struct Summary {
  std::size_t count = 0;
  double mean = 0, rmse = 0, median = 0, p90 = 0, p95 = 0, p99 = 0, p999 = 0, max = 0;
};

/// Quantile `q` in [0, 1] of ascending values, linear between neighbours (numpy's default). `sorted` must not be empty.
double quantile(const std::vector<double>& sorted, double q);

Summary summarise(std::vector<double> values);

}  // namespace epiline
