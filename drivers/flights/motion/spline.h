#pragma once
// Uniform cubic B-splines of vectors and of rotations.
#include <array>
#include <vector>

#include "estimator/geometry/types.h"

namespace epiline {

/// Weights of a piece's four controls at the place u in [0, 1] of the piece, and their derivatives by u.
struct CubicWeights {
  std::array<double, 4> value, first, second;
};
CubicWeights cubic_weights(double u);

/// A piece of a spline and the place in it.
struct SplinePlace {
  int piece;
  double u;  ///< in [0, 1]; beyond the first and the last piece, outside of it
};
/// `controls`: their count, four at least.
SplinePlace spline_place(double t_s, double interval_s, std::size_t controls);

/// A uniform cubic B-spline of 3-vectors. Twice continuously differentiable.
class CubicSpline {
 public:
  struct Value {
    Vec3 value, first, second;  ///< and its derivatives by time
  };
  CubicSpline() = default;
  /// `controls`: four at least. Control i weighs most at the time (i - 1) * `interval_s`.
  CubicSpline(double interval_s, std::vector<Vec3> controls);
  /// `t_s` in [0, end_s()]; outside, the last piece is continued.
  Value at(double t_s) const;
  double end_s() const { return interval_s_ * static_cast<double>(controls_.size() - 3); }

 private:
  double interval_s_ = 1;
  std::vector<Vec3> controls_;
};

/// A uniform cumulative cubic B-spline of rotations (Sommer et al. 2020): R = R_0 Exp(w_1 d_1) Exp(w_2 d_2) Exp(w_3
/// d_3) with d_j = Log(R_{j-1}^T R_j) and w_j the sum of the weights from j on. Twice continuously differentiable.
class RotationSpline {
 public:
  struct Value {
    Mat3 R_WB;
    Vec3 omega_B, alpha_B;  ///< rad/s, rad/s^2
  };
  RotationSpline() = default;
  /// `controls`: four at least, neighbours less than pi apart.
  RotationSpline(double interval_s, std::vector<Mat3> controls);
  Value at(double t_s) const;
  double end_s() const { return interval_s_ * static_cast<double>(controls_.size() - 3); }

 private:
  double interval_s_ = 1;
  std::vector<Mat3> controls_;
  std::vector<Vec3> steps_;  ///< from each control to the next
};

}  // namespace epiline
