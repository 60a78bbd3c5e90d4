#include "drivers/replay/flight_plan.h"

#include <sys/resource.h>

#include <algorithm>

namespace epiline {

FlightPlan plan_flight(const AslDataset& dataset, const ReplayOptions& options) {
  FlightPlan plan;
  const Span shift = Span::from_seconds(options.shift_images_ms * 1e-3);
  HostStamp first = dataset.instant(0), last = first;
  for (std::size_t i = 0; i < dataset.instants_count(); ++i) {
    first = std::min(first, dataset.instant(i));
    last = std::max(last, dataset.instant(i));
  }
  plan.duration_s = (last - first).seconds();
  plan.skipped = {{"out_of_order", 0}, {"duplicate", 0}, {"refused_by_watch", 0}};
  for (std::size_t i = 0; i < dataset.instants_count(); ++i) {
    const double t = (dataset.instant(i) - first).seconds();
    if (t < options.start_s || t - options.start_s > options.duration_s) continue;
    ++plan.chosen;
    const HostStamp stamp = dataset.instant(i) + shift;
    if (!plan.images.empty() && stamp <= plan.images.back().stamp) {
      ++plan.skipped[stamp == plan.images.back().stamp ? "duplicate" : "out_of_order"];
    } else {
      plan.images.push_back({i, stamp});
    }
  }
  const HostStamp imu_from = first + Span::from_seconds(options.start_s - 1.0) + shift;
  while (plan.first_imu < dataset.imu_samples.size() && dataset.imu_samples[plan.first_imu].stamp < imu_from)
    ++plan.first_imu;
  return plan;
}

FlightRecord begin_record(const AslDataset& dataset, const FlightPlan& plan, const Config& config,
                          const ReplayOptions& options) {
  FlightRecord record;
  record.dataset_path = options.dataset.string();
  record.dataset_duration_s = plan.duration_s;
  record.dataset_images = dataset.instants_count();
  record.dataset_imu_samples = dataset.imu_samples.size();
  record.truth = dataset.ground_truth;
  record.visual_factor = to_string(config.estimator.visual_factor);
  record.keyframes = config.estimator.keyframes;
  if (!dataset.images.empty()) record.max_features = config.tracker.max_features;
  if (config.deadline_ms > 0) record.deadline_ms = config.deadline_ms;
  record.images_read = plan.chosen;
  record.skipped = plan.skipped;
  record.images.reserve(plan.images.size());
  return record;
}

double peak_rss_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace epiline
