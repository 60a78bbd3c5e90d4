#include "drivers/flights/motion/profile_matrix.h"

#include <Eigen/Cholesky>
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

ProfileMatrix::ProfileMatrix(std::vector<int> first) : first_(std::move(first)), border_(size()) {
  while (border_ > 0 && first_[static_cast<std::size_t>(border_ - 1)] == 0) --border_;
  std::ptrdiff_t end = 0;
  for (int i = 0; i < size(); ++i) {
    begin_.push_back(end - first_[static_cast<std::size_t>(i)]);
    end += i - first_[static_cast<std::size_t>(i)] + 1;
  }
  values_.assign(static_cast<std::size_t>(end), 0);
}

void ProfileMatrix::set_zero() { std::fill(values_.begin(), values_.end(), 0); }

bool ProfileMatrix::factorise() {
  for (int i = 0; i < border_; ++i) {
    const int first_i = first_[static_cast<std::size_t>(i)];
    eliminate(i, i);
    const double pivot = at(i, i) - dot(row(i) + first_i, row(i) + first_i, i - first_i);
    if (!(pivot > 0)) return false;
    at(i, i) = std::sqrt(pivot);
  }
  for (int i = border_; i < size(); ++i) eliminate(i, border_);
  return factorise_border();
}

void ProfileMatrix::eliminate(int i, int end) {
  const int first_i = first_[static_cast<std::size_t>(i)];
  for (int j = first_i; j < end; ++j) {
    const int k = std::max(first_i, first_[static_cast<std::size_t>(j)]);
    at(i, j) = (at(i, j) - dot(row(i) + k, row(j) + k, j - k)) / at(j, j);
  }
}

bool ProfileMatrix::factorise_border() {
  const int rows = size() - border_;
  Eigen::MatrixXd A(rows, rows), before(border_, rows);  // the triangle, and each row of L before it as a column
  for (int r = 0; r < rows; ++r) {
    const double* from = row(border_ + r);
    std::copy(from, from + border_, before.col(r).data());
    for (int c = 0; c <= r; ++c) A(r, c) = from[border_ + c];
  }
  // Eigen divides by the sizes of a product
  if (before.size() > 0) A.selfadjointView<Eigen::Lower>().rankUpdate(before.transpose(), -1);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> L(A);  // in place
  if (L.info() != Eigen::Success || !A.diagonal().allFinite()) return false;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c <= r; ++c) at(border_ + r, border_ + c) = A(r, c);
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
