#pragma once
// How a camera turned while the rows of an image, or a second image, were exposed. Derivation:
// docs/derivations/rolling_shutter.md; test: tests/estimator/geometry/row_turn_test.cc.
#include "estimator/geometry/so3.h"
#include "estimator/geometry/types.h"

namespace epiline {

/// To second order in time, which is what the readings say within an image.
struct RowTurn {
  Vec3 omega_C = Vec3::Zero(), alpha_C = Vec3::Zero();  ///< at the image's stamp, rad/s and rad/s^2

  /// Attitude of the camera at `row_s` seen from the camera at the stamp: takes a bearing of that row to the stamp.
  Mat3 at(double row_s) const { return so3_exp((omega_C + 0.5 * row_s * alpha_C) * row_s); }
  /// Of another camera D of the same body.
  RowTurn seen_from(const Mat3& R_CD) const { return {R_CD.transpose() * omega_C, R_CD.transpose() * alpha_C}; }
};

/// From the body's turns over the `half_s` seconds before the stamp and the `half_s` after it.
inline RowTurn row_turn(const Mat3& R_before, const Mat3& R_after, double half_s, const Mat3& R_BC) {
  const Vec3 before = so3_log(R_before), after = so3_log(R_after);
  return {R_BC.transpose() * (before + after) / (2 * half_s), R_BC.transpose() * (after - before) / (half_s * half_s)};
}

}  // namespace epiline
