#pragma once
// What a fit of a motion takes: readings and poses that are whole and cover the same time.
#include <vector>

#include "drivers/flights/motion/readings.h"
#include "drivers/laboratory/simulate/motion_fit.h"

namespace epiline {

/// The poses within the time that the IMU covers. Fails if and only if they cover less than settings.shortest_s, have a
/// gap longer than settings.longest_gap_s, or hold what is no pose.
Result<std::vector<TimedPose>> usable_poses(const std::vector<ImuSample>& imu, const Trajectory& truth,
                                            const FitSettings& settings);

/// The readings from the first to the last pose.
std::vector<ImuSample> within(const std::vector<ImuSample>& imu, const std::vector<TimedPose>& poses);

}  // namespace epiline
