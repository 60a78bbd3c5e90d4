#pragma once
// The normal equations of a fitted motion, in an order of the unknowns that keeps the matrix narrow.
#include <Eigen/Core>
#include <array>
#include <vector>

#include "drivers/flights/motion/profile_matrix.h"
#include "estimator/geometry/types.h"

namespace epiline {

/// e(x + d) ~ e + sum of J_i d_i; `weight` is that of |e|^2.
struct FitResidual {
  struct Term {
    int column, width;
    Mat3 J;  ///< its first `width` columns
  };
  Vec3 e;
  double weight;
  std::array<Term, 16> terms;
  std::size_t count = 0;
  FitResidual(const Vec3& value, double w) : e(value), weight(w) {}
  void add(int column, const Mat3& J, int width = 3) { terms[count++] = {column, width, J}; }
};

/// Where the unknowns stand: knots of the motion in time order, each knot of the biases behind the last knot of the
/// motion it shares a reading with, the constants at the end. The profile stays short that way.
struct FitLayout {
  FitLayout(int knots, int biases, double knots_per_bias);
  /// Columns for that many constants, behind all others; returns the first.
  int add_constants(int count) { return add(count, 0); }

  std::vector<int> knot;   ///< column of (position, rotation), six each
  std::vector<int> bias;   ///< column of (gyroscope, accelerometer), six each
  std::vector<int> first;  ///< the profile

 private:
  /// The first of `count` columns of which the profile begins at column `from`.
  int add(int count, int from);
};

/// H step = b, b the negative gradient.
class FitEquations {
 public:
  /// `first`: see ProfileMatrix.
  explicit FitEquations(const std::vector<int>& first) : H_(first), b_(first.size()) {}
  void clear();
  void add(const FitResidual& r);
  /// Adds `block` to H from that row and column on; of a block on the diagonal, the lower triangle. Rows come behind
  /// columns, or begin with them.
  void add_block(int row, int column, const Eigen::Ref<const Eigen::MatrixXd>& block);
  void add_to_b(int row, const Eigen::Ref<const Eigen::VectorXd>& values);
  /// Pulls `count` unknowns from `column` on towards no step.
  void damp(int column, int count, double weight);
  /// The same by a share of what stands on the diagonal.
  void damp_by_share(int column, int count, double share);
  /// Call once after adding. False if and only if H is not positive definite.
  bool solve(std::vector<double>& step);
  /// After solve(): b <- H^-1 b.
  void solve_again(std::vector<double>& b) const { H_.solve(b); }

 private:
  ProfileMatrix H_;
  std::vector<double> b_;
};

}  // namespace epiline
