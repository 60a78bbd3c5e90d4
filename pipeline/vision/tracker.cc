#include "pipeline/vision/tracker.h"

namespace epiline {

struct Tracker::Impl {
  TrackerStats stats;
};

Tracker::Tracker(const Camera&, const TrackerConfig&) : impl_(std::make_unique<Impl>()) {}
Tracker::~Tracker() = default;

void Tracker::step(const Frame& image, const Mat3&, TrackedFrame& out) noexcept {
  out.stamp = image.stamp;
  out.sequence = image.sequence;
  out.features.clear();
  ++impl_->stats.images;
}

void Tracker::reset() noexcept {}
const TrackerStats& Tracker::stats() const noexcept { return impl_->stats; }
const char* simd_target() noexcept { return "none"; }

}  // namespace epiline
