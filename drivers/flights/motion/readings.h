#pragma once
// What a fit of a motion to an IMU's readings asks of them.
#include <string>
#include <utility>
#include <vector>

#include "platform/error/result.h"
#include "platform/math/statistics.h"
#include "platform/samples/samples.h"

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

/// For error messages, to the nanosecond.
std::string seconds_text(HostStamp stamp);

}  // namespace epiline
