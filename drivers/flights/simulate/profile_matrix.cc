#include "drivers/flights/simulate/profile_matrix.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

namespace epiline {
namespace {
double dot(const double* a, const double* b, int count) {
  using Map = Eigen::Map<const Eigen::VectorXd>;
  return Map(a, count).dot(Map(b, count));
}
}  // namespace

ProfileMatrix::ProfileMatrix(std::vector<int> first) : first_(std::move(first)) {
  std::ptrdiff_t end = 0;
  for (int i = 0; i < size(); ++i) {
    begin_.push_back(end - first_[static_cast<std::size_t>(i)]);
    end += i - first_[static_cast<std::size_t>(i)] + 1;
  }
  values_.assign(static_cast<std::size_t>(end), 0);
}

void ProfileMatrix::set_zero() { std::fill(values_.begin(), values_.end(), 0); }

bool ProfileMatrix::factorise() {
  for (int i = 0; i < size(); ++i) {
    const int first_i = first_[static_cast<std::size_t>(i)];
    for (int j = first_i; j < i; ++j) {
      const int k = std::max(first_i, first_[static_cast<std::size_t>(j)]);
      at(i, j) = (at(i, j) - dot(row(i) + k, row(j) + k, j - k)) / at(j, j);
    }
    const double pivot = at(i, i) - dot(row(i) + first_i, row(i) + first_i, i - first_i);
    if (!(pivot > 0)) return false;
    at(i, i) = std::sqrt(pivot);
  }
  return true;
}

void ProfileMatrix::solve(std::vector<double>& b) const {
  for (int i = 0; i < size(); ++i) {
    const int first = first_[static_cast<std::size_t>(i)];
    b[static_cast<std::size_t>(i)] =
        (b[static_cast<std::size_t>(i)] - dot(row(i) + first, b.data() + first, i - first)) / at(i, i);
  }
  for (int i = size() - 1; i >= 0; --i) {
    const double x = b[static_cast<std::size_t>(i)] /= at(i, i);
    for (int j = first_[static_cast<std::size_t>(i)]; j < i; ++j) b[static_cast<std::size_t>(j)] -= x * at(i, j);
  }
}

}  // namespace epiline
