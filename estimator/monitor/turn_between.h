#pragma once
// The rotation of a camera between two images, from bearings alone. Derivation: docs/derivations/turns.md; test:
// tests/estimator/monitor/turn_watch_test.cc.
#include "estimator/geometry/types.h"
#include "estimator/monitor/turn_kernels.h"

namespace epiline {

/// Bearings of the points that two images share.
struct SharedBearings {
  static constexpr int kMost = kMostShared, kFewest = 12;
  struct Rows : BearingRows {
    Rows() : BearingRows{} {}
    Vec3 at(int i) const { return {x[i], y[i], z[i]}; }
    void set(int i, const Vec3& f) {
      x[i] = static_cast<float>(f.x());
      y[i] = static_cast<float>(f.y());
      z[i] = static_cast<float>(f.z());
    }
  };
  int count = 0;
  Rows before, now;
};

/// The camera's motion: f_now ~ R_CC0 f_before, except for parallax along `direction`.
struct CameraTurn {
  Mat3 R_CC0 = Mat3::Identity();
  Vec3 direction = Vec3::UnitX();  ///< of the translation, unit vector in C; the sign is arbitrary
  double cost = 0;                 ///< mean of log(1 + (angle to the epipolar plane/kCostScale_rad)^2)
};

/// Robust fit of rotation and direction of translation. `R_CC0`, `hint`: initial rotation and direction; others are
/// tried only if the fit from there costs more than `usual_cost`, and is not good anyway. Bounded work, no heap. False:
/// too few bearings.
bool turn_between(const SharedBearings& bearings, const Mat3& R_CC0, const Vec3& hint, double usual_cost,
                  const TurnKernels& kernels, CameraTurn& out) noexcept;

/// If all points lie in one plane, n'X = 1 in the camera before and |t| = 1, the images are a homography R + t n', and
/// R + n t' explains them as well after a turn by t x n more. Of the two rotations, takes the one that has all points
/// in front of the camera. Returns how far apart they are, rad, if that tells them not apart, or if it is less than
/// `least`; 0: no plane, or told apart. `turn`: of these bearings.
double settle_plane(const SharedBearings& bearings, double least, const TurnKernels& kernels,
                    CameraTurn& turn) noexcept;

/// The rotation R that maximises tr(R^T sum). With `sum` = sum of b a^T it rotates a to b best (Kabsch).
Mat3 rotation_from(const Mat3& sum) noexcept;

}  // namespace epiline
