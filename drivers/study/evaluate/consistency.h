#pragma once
// Whether an estimator's covariance covers its errors. Derivation: docs/derivations/consistency.md.
#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/study/evaluate/calibration_curve.h"
#include "pipeline/text/trajectory.h"

namespace epiline {

/// What the estimator claims about one of its poses.
struct PoseUncertainty {
  Mat3 position = Mat3::Zero();  ///< covariance of p_WB in W, m^2
  double yaw_variance = 0;       ///< of the rotation about W's z axis, rad^2
  std::uint32_t segment = 0;     ///< increases when the estimator restarts with another origin and heading
  Mat3 velocity = Mat3::Zero();  ///< covariance of v_WB in W, m^2/s^2
  Eigen::Matrix2d tilt = Eigen::Matrix2d::Zero();  ///< of the rotation about W's x and y axes, rad^2
};

/// The pose that gave a segment its origin and heading. Its position and yaw have (almost) no error by definition; the
/// covariances of all poses of the segment are relative to it. It may lie before the segment's first pose.
struct SegmentOrigin {
  std::uint32_t segment = 0;
  TimedPose pose;
};

struct Claims {
  std::vector<PoseUncertainty> poses;  ///< empty, or runs along with the estimate's poses
  std::vector<SegmentOrigin> origins;
};

/// An estimated pose and the true one at its time.
struct PosePair {
  TimedPose estimate, reference;
  std::size_t index = 0;  ///< of the estimate in its trajectory
};

struct CalibrationCurves {
  CalibrationCurve position, yaw, velocity, tilt;
};

/// Normalised estimation errors squared: means over the poses, per degree of freedom, 1 where the covariance tells the
/// truth; and how they are distributed.
struct Consistency {
  std::optional<double> position, yaw, velocity, tilt;
  CalibrationCurves curves;
};

/// Poses of segments without an origin, or with an origin outside the reference, are not judged. Velocities are judged
/// where both trajectories have them.
Consistency consistency(const std::vector<PosePair>& pairs, const Trajectory& estimate, const Trajectory& reference,
                        const Claims& claims);

/// Signed yaw (rad) that turns the estimate's heading into the reference's.
double yaw_error(const TimedPose& estimate, const TimedPose& reference);

/// The velocity (W, m/s) of a reference that has velocities, at a time that it reaches.
Vec3 velocity_at(const Trajectory& reference, HostStamp stamp);

/// The longest hole in the reference that may be interpolated over: 0.1 s, or 2.5 usual intervals where the reference
/// is slower than that.
Span longest_gap(const Trajectory& reference);

}  // namespace epiline
