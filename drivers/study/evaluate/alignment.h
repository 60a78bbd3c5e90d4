#pragma once
// The transformation that lays an estimated path over the true one. Derivation: docs/derivations/alignment.md.
#include <optional>
#include <string>
#include <vector>

#include "estimator/geometry/types.h"

namespace epiline {

enum class Alignment {
  kNone,
  k4Dof,  ///< translation and yaw: what visual-inertial odometry cannot know
  kSe3,   ///< translation and rotation
  kSim3,  ///< translation, rotation and scale
};

std::optional<Alignment> alignment_from(const std::string& name);

/// x -> s R x + t
struct Similarity {
  double s = 1;
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();
  Vec3 operator()(const Vec3& x) const { return s * (R * x) + t; }
};

/// The member of the family that minimises the sum of |reference_i - (s R estimate_i + t)|^2, in closed form (Horn
/// 1987). Where the points do not determine it (too few, or on a line), one of the minimisers. Both lists have the same
/// length; empty ones give the identity.
Similarity align(Alignment family, const std::vector<Vec3>& estimate, const std::vector<Vec3>& reference);

/// The rotation about z that comes closest to R, as an angle (rad).
double yaw_of(const Mat3& R);
Mat3 yaw_rotation(double yaw_rad);

}  // namespace epiline
