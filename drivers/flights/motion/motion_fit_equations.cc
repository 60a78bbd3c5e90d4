#include "drivers/flights/motion/motion_fit_equations.h"

#include <algorithm>

namespace epiline {

FitLayout::FitLayout(int knots, int biases, double knots_per_bias) {
  const auto knot_near = [&](int m, int margin) {
    return std::clamp(static_cast<int>(m * knots_per_bias) + margin, 0, knots - 1);
  };
  for (int k = 0; k < knots; ++k) {
    knot.push_back(add(6, knot.empty() ? 0 : knot[static_cast<std::size_t>(std::max(0, k - 3))]));
    for (int m = static_cast<int>(bias.size()); m < biases && (k == knots - 1 || knot_near(m + 1, 5) <= k); ++m)
      bias.push_back(add(6, knot[static_cast<std::size_t>(knot_near(m - 1, -1))]));
  }
}

int FitLayout::add(int count, int from) {
  const int column = static_cast<int>(first.size());
  first.insert(first.end(), static_cast<std::size_t>(count), from);
  return column;
}

void FitEquations::clear() {
  H_.set_zero();
  std::fill(b_.begin(), b_.end(), 0);
}

void FitEquations::add(const FitResidual& r) {
  for (std::size_t i = 0; i < r.count; ++i) {
    const FitResidual::Term& a = r.terms[i];
    const Vec3 gradient = r.weight * a.J.transpose() * r.e;
    for (int k = 0; k < a.width; ++k) b_[static_cast<std::size_t>(a.column + k)] -= gradient[k];
    for (std::size_t j = 0; j < r.count; ++j) {
      const FitResidual::Term& c = r.terms[j];
      if (c.column > a.column) continue;
      const Mat3 block = r.weight * a.J.transpose() * c.J;
      for (int k = 0; k < a.width; ++k)
        for (int l = 0; l < (i == j ? k + 1 : c.width); ++l) H_.at(a.column + k, c.column + l) += block(k, l);
    }
  }
}

void FitEquations::add_block(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block) {
  for (int k = 0; k < block.rows(); ++k)
    for (int l = 0; l < (row == column ? k + 1 : block.cols()); ++l) H_.at(row + k, column + l) += block(k, l);
}

void FitEquations::add_to_b(int row, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (int k = 0; k < values.size(); ++k) b_[static_cast<std::size_t>(row + k)] += values[k];
}

void FitEquations::damp(int column, int count, double weight) {
  for (int k = column; k < column + count; ++k) H_.at(k, k) += weight;
}

void FitEquations::damp_by_share(int column, int count, double share) {
  for (int k = column; k < column + count; ++k) H_.at(k, k) *= 1 + share;
}

bool FitEquations::solve(std::vector<double>& step) {
  if (!H_.factorise()) return false;
  step = b_;
  H_.solve(step);
  return true;
}

}  // namespace epiline
