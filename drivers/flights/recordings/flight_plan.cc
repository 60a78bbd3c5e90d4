#include "drivers/flights/recordings/flight_plan.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <utility>

namespace epiline {

namespace {

constexpr Span kSameTime = Span::from_milliseconds(1);
constexpr double kTriggered = 0.9;  // share of the pairs that are of the same time

/// Half of the usual time between two images.
Span half_period(const std::vector<PlannedImage>& images) {
  std::vector<std::int64_t> periods_ns;
  for (std::size_t k = 1; k < images.size(); ++k) periods_ns.push_back((images[k].stamp - images[k - 1].stamp).ns);
  if (periods_ns.empty()) return kSameTime;
  const auto middle = periods_ns.begin() + static_cast<std::ptrdiff_t>(periods_ns.size() / 2);
  std::nth_element(periods_ns.begin(), middle, periods_ns.end());
  return Span{*middle / 2};
}

/// Gives each image of the first camera the nearest one of the other within `within` that is not another's; both in
/// the order of time. `later`: what is added to the stamps of the other camera.
void pair_images(const AslDataset& first, std::size_t other, Span within, Span later,
                 std::vector<PlannedImage>& images) {
  const std::vector<ImageFile>& files = first.others[other]->images;
  std::vector<std::size_t> order(files.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return files[a].stamp < files[b].stamp; });
  auto next = order.begin();
  for (PlannedImage& image : images) {
    const HostStamp stamp = first.instant(image.index);
    const auto later_of = [&](std::size_t i) { return files[i].stamp + later - stamp; };
    const auto apart_ns = [&](std::size_t i) { return std::abs(later_of(i).ns); };
    image.others[other].reset();
    while (next != order.end() && later_of(*next).ns < -within.ns) ++next;
    if (next == order.end() || apart_ns(*next) > within.ns) continue;
    while (next + 1 != order.end() && apart_ns(next[1]) < apart_ns(*next)) ++next;
    image.later[other] = later_of(*next);
    image.others[other] = *next++;
  }
}

/// Triggered together, nearly all pairs are of the same time; then these alone count, and as of the same time exactly.
void pair_images(const AslDataset& first, std::size_t other, FlightPlan& plan) {
  const auto pairs = [&] {
    const auto is_pair = [&](const PlannedImage& i) { return i.others[other].has_value(); };
    return std::count_if(plan.images.begin(), plan.images.end(), is_pair);
  };
  pair_images(first, other, kSameTime, {}, plan.images);
  const auto same = pairs();
  std::vector<PlannedImage> triggered = plan.images;
  const Span later = Span::from_seconds(first.others[other]->camera.time_offset_s - first.camera.time_offset_s);
  pair_images(first, other, std::max(kSameTime, half_period(plan.images)), later, plan.images);
  if (static_cast<double>(same) >= kTriggered * static_cast<double>(pairs())) {
    plan.images = std::move(triggered);
    for (PlannedImage& image : plan.images) image.later[other] = {};
    return;
  }
  for (const PlannedImage& image : plan.images)
    if (image.others[other]) plan.apart[other] = std::max(plan.apart[other], Span{std::abs(image.later[other].ns)});
}

}  // namespace

FlightPlan plan_flight(const AslDataset& dataset, const FlightPart& part) {
  FlightPlan plan;
  const Span shift = Span::from_seconds(part.shift_images_ms * 1e-3);
  const auto [first, last] = dataset.extent();
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
  for (std::size_t i = 0; i < dataset.others.size(); ++i) pair_images(dataset, i, plan);
  const HostStamp imu_from = first + Span::from_seconds(part.start_s - 1.0) + shift;
  while (plan.first_imu < dataset.imu_samples.size() && dataset.imu_samples[plan.first_imu].stamp < imu_from)
    ++plan.first_imu;
  return plan;
}

}  // namespace epiline
