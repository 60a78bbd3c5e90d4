#include "drivers/flights/recordings/flight_plan.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

namespace epiline {

namespace {

constexpr Span kSameTime = Span::from_milliseconds(1);

/// Finds the images of the second camera that belong to those of the first one.
void pair_images(const AslDataset& first, std::vector<PlannedImage>& images) {
  const std::vector<ImageFile>& files = first.second->images;
  std::vector<std::size_t> order(files.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return files[a].stamp < files[b].stamp; });
  for (PlannedImage& image : images) {
    const HostStamp stamp = first.instant(image.index);
    const auto from = std::partition_point(order.begin(), order.end(),
                                           [&](std::size_t i) { return files[i].stamp < stamp - kSameTime; });
    Span least = kSameTime;
    for (auto i = from; i != order.end() && files[*i].stamp <= stamp + kSameTime; ++i) {
      const Span apart{std::abs((files[*i].stamp - stamp).ns)};
      if (image.second && apart.ns >= least.ns) continue;
      least = apart;
      image.second = *i;
    }
  }
}

}  // namespace

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
      plan.images.push_back({i, stamp, {}});
    }
  }
  if (dataset.second) pair_images(dataset, plan.images);
  const HostStamp imu_from = first + Span::from_seconds(part.start_s - 1.0) + shift;
  while (plan.first_imu < dataset.imu_samples.size() && dataset.imu_samples[plan.first_imu].stamp < imu_from)
    ++plan.first_imu;
  return plan;
}

}  // namespace epiline
