#pragma once
// A trajectory: poses over time, from a file or an estimator.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "estimator/geometry/types.h"
#include "platform/error/result.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Pose of the body B in a world W.
struct TimedPose {
  HostStamp stamp;
  Vec3 p_WB = Vec3::Zero();  ///< m
  Eigen::Quaterniond q_WB = Eigen::Quaterniond::Identity();
};

/// Poses in strictly increasing time. The other lists are empty or run along with `poses`.
struct Trajectory {
  std::vector<TimedPose> poses;
  std::vector<Vec3> v_WB_m_s;
  std::vector<Vec3> gyroscope_bias_rad_s;
  std::vector<Vec3> accelerometer_bias_m_s2;
  /// Rows of the file that were left out: not finite or without a rotation; out of order or repeated.
  std::size_t not_finite = 0, out_of_order = 0;
  /// The file's quaternion that is furthest from unit length: by how much, and when. `poses` has it normalised.
  double worst_norm_error = 0;
  HostStamp worst_norm_at;
  std::vector<std::string> notes;  ///< for the user: an unusual unit or order of the file
};

/// Appends the pose with a quaternion of length one. False, and counted, if it is not finite, has no rotation, or does
/// not lie after the last one.
bool add_pose(const TimedPose& pose, Trajectory& trajectory);

/// Reads an ASL ground truth (csv: t_ns, p, q wxyz [, v [, bias of gyroscope, of accelerometer]]) or a TUM trajectory
/// (t_s tx ty tz qx qy qz qw), plain or gzipped; the first line with data tells which. A header that names qw in
/// another place is followed. Fails if and only if the file cannot be read, a line does not parse, or no pose is left.
Result<Trajectory> read_trajectory(const std::filesystem::path& path);

/// The poses in TUM's format, one a line: time in seconds with nine decimals, from the integer; w of the quaternion
/// last.
std::string tum_text(const Trajectory& trajectory);

/// Linear and spherical interpolation at `stamp`. False outside the trajectory and in its gaps: where the neighbours
/// are further apart than `max_gap`. `hint` speeds up queries in time order: where the last one was found.
bool interpolate(const Trajectory& trajectory, HostStamp stamp, Span max_gap, TimedPose& pose, std::size_t& hint);

}  // namespace epiline
