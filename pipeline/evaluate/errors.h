#pragma once
// How far an estimated trajectory is from the truth.
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/evaluate/alignment.h"
#include "pipeline/evaluate/statistics.h"
#include "pipeline/evaluate/trajectory.h"

namespace epiline {

/// What the estimator claims about one of its poses.
struct PoseUncertainty {
  Mat3 position = Mat3::Zero();  ///< covariance of p_WB in W, m^2
  double yaw_variance = 0;       ///< of the rotation about W's z axis, rad^2
  std::uint32_t segment = 0;     ///< grows when the estimator starts anew: another origin and heading
};

/// An estimated pose and the true one at its time.
struct PosePair {
  TimedPose estimate, reference;
  std::size_t index = 0;  ///< of the estimate in its trajectory
};

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

struct TrajectoryErrors {
  std::size_t poses = 0;                          ///< estimated poses with a reference
  double path_length_m = 0;                       ///< of the reference over these poses
  Summary ate_none, ate_4dof, ate_se3, ate_sim3;  ///< absolute trajectory error, m
  double scale_error = 0;                         ///< estimated over true length, minus 1
  double yaw_drift_deg = 0;                       ///< yaw error over the last second minus over the first
  std::vector<RelativeError> rpe;                 ///< over 1, 2, 5, 10, 20, ... m, as far as the path reaches
  std::optional<double> nees_position,
      nees_yaw;  ///< mean, per degree of freedom; aligned at the first pose of each segment
  const Summary& ate(Alignment alignment) const;
};

/// Whether a position error says that an estimate has left the path altogether: more than 2 m and more than a tenth of
/// the path, or not a number.
bool has_diverged(double error_m, double path_length_m);

/// `uncertainty` is empty or runs along with `estimate.poses`. Without a single pair `poses` is zero and so is
/// everything else.
TrajectoryErrors evaluate(const Trajectory& estimate, const Trajectory& reference,
                          const std::vector<PoseUncertainty>& uncertainty = {});

/// Signed yaw (rad) that turns the estimate's heading into the reference's.
double yaw_error(const PosePair& pair);

}  // namespace epiline
