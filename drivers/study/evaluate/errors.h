#pragma once
// How far an estimated trajectory is from the truth.
#include <vector>

#include "drivers/study/evaluate/alignment.h"
#include "drivers/study/evaluate/consistency.h"
#include "pipeline/text/trajectory.h"
#include "platform/math/statistics.h"

namespace epiline {

/// Pairs every estimated pose with the interpolated reference; poses outside the reference or in its gaps have no pair.
/// A gap is a hole of more than 0.1 s, or of 2.5 usual intervals where the reference is slower than that.
std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& reference);

/// An estimated path and how it comes to lie on the true one by origin and heading.
struct Overlay {
  std::vector<PosePair> pairs;
  Similarity T;            ///< estimate to reference, four degrees of freedom
  double heading_rad = 0;  ///< mean yaw error, to be taken out of the single ones
};
Overlay overlay(const Trajectory& estimate, const Trajectory& reference);

/// Drift over pieces of the true path of one length.
struct RelativeError {
  double distance_m = 0;
  double translation_percent = 0;  ///< mean error of the relative translation over the distance
  double rotation_deg = 0;         ///< mean angle of the error of the relative rotation
  std::size_t pairs = 0;
};

/// Errors of the motion over one length of time, seen from the body at its beginning. They depend on no alignment.
struct MotionError {
  double seconds = 0;
  Summary translation_m, rotation_deg;
};

struct TrajectoryErrors {
  std::size_t poses = 0;                          ///< estimated poses with a reference
  double path_length_m = 0;                       ///< of the reference over these poses
  Summary ate_none, ate_4dof, ate_se3, ate_sim3;  ///< absolute trajectory error, m
  double scale_error = 0;                         ///< estimated over true length, minus 1
  double yaw_drift_deg = 0;                       ///< yaw error over the last second minus over the first
  std::vector<RelativeError> rpe;                 ///< over 1, 2, 5, 10, 20, ... m, as far as the path reaches
  std::vector<MotionError> motion;                ///< over 1, 5 and 20 s, as far as the flight reaches
  Consistency nees;                               ///< of what the estimator claimed; empty without claims
  const Summary& ate(Alignment alignment) const;
};

/// Without a single pair `poses` is zero and so is everything else.
TrajectoryErrors evaluate(const Trajectory& estimate, const Trajectory& reference, const Claims& claims = {});

double yaw_error(const PosePair& pair);

}  // namespace epiline
