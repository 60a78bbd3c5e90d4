#include "drivers/flights/recordings/flight_plan.h"

#include <algorithm>

namespace epiline {

FlightPlan plan_flight(const AslDataset& dataset, const FlightPart& part) {
  FlightPlan plan;
  const Span shift = Span::from_seconds(part.shift_images_ms * 1e-3);
  HostStamp first = dataset.instant(0), last = first;
  for (std::size_t i = 0; i < dataset.instants_count(); ++i) {
    first = std::min(first, dataset.instant(i));
    last = std::max(last, dataset.instant(i));
  }
  plan.duration_s = (last - first).seconds();
  plan.skipped = {{"out_of_order", 0}, {"duplicate", 0}, {"refused_by_watch", 0}};
  for (std::size_t i = 0; i < dataset.instants_count(); ++i) {
    const double t = (dataset.instant(i) - first).seconds();
    if (t < part.start_s || t - part.start_s > part.duration_s) continue;
    ++plan.chosen;
    const HostStamp stamp = dataset.instant(i) + shift;
    if (!plan.images.empty() && stamp <= plan.images.back().stamp) {
      ++plan.skipped[stamp == plan.images.back().stamp ? "duplicate" : "out_of_order"];
    } else {
      plan.images.push_back({i, stamp});
    }
  }
  const HostStamp imu_from = first + Span::from_seconds(part.start_s - 1.0) + shift;
  while (plan.first_imu < dataset.imu_samples.size() && dataset.imu_samples[plan.first_imu].stamp < imu_from)
    ++plan.first_imu;
  return plan;
}

}  // namespace epiline
