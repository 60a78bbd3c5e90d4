#pragma once
// A symmetric matrix whose rows are mostly zero up to their first entry, and its Cholesky factor.
#include <cstddef>
#include <vector>

namespace epiline {

/// Stores row i from column first[i] to the diagonal ("skyline"). The factor fills nothing to the left of it, so a
/// chain of small blocks costs what its bandwidth costs. The last rows may begin at column 0 (the "border"): they cost
/// their length, and are multiplied with each other as one dense matrix.
class ProfileMatrix {
 public:
  /// `first[i]` <= i.
  explicit ProfileMatrix(std::vector<int> first);
  int size() const { return static_cast<int>(first_.size()); }
  void set_zero();
  /// `column` in [first[row], row].
  double& at(int row, int column) { return values_[begin_[static_cast<std::size_t>(row)] + column]; }
  double at(int row, int column) const { return values_[begin_[static_cast<std::size_t>(row)] + column]; }
  /// Replaces A by L with A = L L^T. False, with undefined contents, if and only if A is not positive definite.
  bool factorise();
  /// After factorise(): b <- A^-1 b.
  void solve(std::vector<double>& b) const;

 private:
  const double* row(int i) const { return values_.data() + begin_[static_cast<std::size_t>(i)]; }
  /// Row i of L up to column `end` - 1, of which the rows above are known.
  void eliminate(int i, int end);
  /// The border's own triangle of L, after its columns before the border.
  bool factorise_border();

  std::vector<int> first_;
  int border_;                         ///< row from which on all begin at column 0
  std::vector<std::ptrdiff_t> begin_;  ///< where column 0 of the row would be
  std::vector<double> values_;
};

}  // namespace epiline
