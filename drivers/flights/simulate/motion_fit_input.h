#pragma once
// What a fit of a motion takes: readings and poses that are whole and cover the same time.
#include <vector>

#include "drivers/flights/simulate/motion_fit.h"
#include "platform/math/statistics.h"

namespace epiline {

/// Seconds between neighbours; `list` is ordered by its elements' stamps. 0 for fewer than two.
template <class List>
double median_period(const List& list) {
  std::vector<double> periods;
  for (std::size_t i = 1; i < list.size(); ++i) periods.push_back((list[i].stamp - list[i - 1].stamp).seconds());
  return summarise(std::move(periods)).median;
}

/// Fails if and only if a reading is not finite, not later than the one before, or more than five periods after it.
Status check_readings(const std::vector<ImuSample>& imu, const std::string& imu_name);

/// The poses within the time that the IMU covers. Fails if and only if they cover less than settings.shortest_s, have a
/// gap longer than settings.longest_gap_s, or hold what is no pose.
Result<std::vector<TimedPose>> usable_poses(const std::vector<ImuSample>& imu, const Trajectory& truth,
                                            const FitSettings& settings);

/// The readings from the first to the last pose.
std::vector<ImuSample> within(const std::vector<ImuSample>& imu, const std::vector<TimedPose>& poses);

}  // namespace epiline
