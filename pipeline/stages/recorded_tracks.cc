#include "pipeline/stages/recorded_tracks.h"

#include <algorithm>

#include "estimator/geometry/tracked_feature.h"

namespace epiline {

namespace {
bool by_id(const TrackedFeature& a, const TrackedFeature& b) { return a.id < b.id; }
}  // namespace

const TrackedFeature* RecordedTracks::find_previous(std::uint32_t id) const noexcept {
  TrackedFeature wanted;
  wanted.id = id;
  const auto* found = std::lower_bound(previous_.begin(), previous_.end(), wanted, by_id);
  return found != previous_.end() && found->id == id ? found : nullptr;
}

bool RecordedTracks::describe(const TrackPoint& point, double dt_s, TrackedFeature& feature) const noexcept {
  if (!set_pixel(camera_, {point.u, point.v}, feature)) return false;  // as the tracker does it, bit by bit
  feature.id = point.id;
  const TrackedFeature* before = find_previous(point.id);
  if (before && dt_s > 0) {
    feature.age = before->age + 1;
    feature.velocity_px_s = {static_cast<float>((point.u - before->pixel[0]) / dt_s),
                             static_cast<float>((point.v - before->pixel[1]) / dt_s)};
  }
  return true;
}

void RecordedTracks::step(HostStamp stamp, const TrackPoint* points, std::size_t count, TrackedFrame& out) noexcept {
  out.stamp = stamp;
  out.sequence = sequence_++;
  out.features.clear();
  const double dt_s = (stamp - previous_stamp_).seconds();
  for (std::size_t i = 0; i < count; ++i) {
    TrackedFeature feature;
    if (!describe(points[i], dt_s, feature) || !out.features.push_back(feature)) ++left_out_;
  }
  std::sort(out.features.begin(), out.features.end(), by_id);
  const auto same_id = [](const TrackedFeature& a, const TrackedFeature& b) { return a.id == b.id; };
  const auto* end = std::unique(out.features.begin(), out.features.end(), same_id);
  left_out_ += static_cast<std::uint64_t>(out.features.end() - end);
  out.features.resize(static_cast<std::size_t>(end - out.features.begin()));
  previous_ = out.features;
  previous_stamp_ = stamp;
}

}  // namespace epiline
