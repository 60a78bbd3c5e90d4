#pragma once
// odometry.csv: an estimated trajectory with what the estimator claims of its errors (docs/replay.md lists the
// columns).
#include <filesystem>
#include <string>

#include "drivers/study/evaluate/consistency.h"

namespace epiline {

struct ClaimedTrajectory {
  Trajectory trajectory;
  Claims claims;
};

/// The poses must have velocities and claims. Origins come first, as rows without a variance.
std::string odometry_text(const ClaimedTrajectory& odometry);

/// Reads odometry.csv, or what read_trajectory() reads, then without claims. Fails if and only if the file cannot be
/// read, a line does not parse, or no pose is left.
Result<ClaimedTrajectory> read_odometry(const std::filesystem::path& path);

}  // namespace epiline
