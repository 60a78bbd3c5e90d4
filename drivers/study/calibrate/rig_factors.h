#pragma once
// The residuals of a calibration and their derivatives. Derivation: docs/derivations/rig.md; test:
// tests/drivers/study/calibrate/rig_factors_test.cc.
#include <array>

#include "drivers/flights/motion/motion_fit_equations.h"
#include "drivers/study/calibrate/corner_views.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "drivers/study/calibrate/rig_state.h"

namespace epiline {

/// A reading of the IMU, its time since the splines' begin.
struct RigReading {
  double t_s;
  Vec3 w, a;  ///< rad/s, m/s^2
};

/// Columns of knots and biases with the constants behind.
struct RigLayout : FitLayout {
  RigColumns columns;
  int corners = 0;  ///< column of the first corner's offset, three each
  explicit RigLayout(const RigState& state);
};

/// Of a corner's pixel by the pose of the IMU (position, turn in T) and by those constants that images see.
inline constexpr int kMostCornerColumns = 6 + kMostLensColumns + 8;
using CornerJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMostCornerColumns>;

class RigFactors {
 public:
  /// Both must outlive the factors and stay as they are.
  RigFactors(const RigState& state, const RigLayout& layout);

  /// Measured minus expected, in B; `weight` is that of the squared residual.
  FitResidual gyroscope(const RigReading& reading, double weight) const;
  FitResidual accelerometer(const RigReading& reading, double weight) const;

  /// The rig at an image's instant, and how the knots around move it.
  struct View {
    std::array<int, 4> knot;  ///< columns
    std::array<double, 4> weight;
    Motion motion;
  };
  /// `t_s`: the image's stamp, without the time offset.
  View look(double t_s) const;
  /// e: measured minus projected, px. J: of the projected pixel; `by_corner`: by the corner's place in T. False where
  /// the lens does not see the corner.
  bool corner(const View& view, const BoardCorner& corner, Vec2& e, CornerJacobian& J, Mat23& by_corner) const;
  /// Calls `use(corner, e, J, by_corner)` for each corner of the view that the lens sees.
  template <class Use>
  void each_corner(const View& at, const CornerView& view, const Use& use) const {
    Vec2 e;
    CornerJacobian J;
    Mat23 by_corner;
    for (const BoardCorner& seen : view.corners) {
      if (corner(at, seen, e, J, by_corner)) use(seen, e, J, by_corner);
    }
  }
  /// Column of that corner's offset.
  int column(const BoardCorner& corner) const;

 private:
  struct Place {
    std::array<int, 4> knot;
    CubicWeights weights;
    std::array<int, 2> bias;
    std::array<double, 2> bias_weight;
  };
  Place place(double t_s) const;
  void add_biases(const Place& at, int part, FitResidual& r) const;

  const RigState& state_;
  const RigLayout& layout_;
  FittedMotion motion_;
  LensProjection lens_;
};

}  // namespace epiline
