#include "pipeline/stages/offline.h"

#include <algorithm>
#include <utility>

namespace epiline {

OfflinePipeline::OfflinePipeline(const OfflineSettings& settings)
    : clocks_(settings.clocks),
      imu_gate_({settings.estimator.saturation_gyroscope_rad_s, settings.estimator.saturation_accelerometer_m_s2}),
      recorded_(Camera(settings.camera)),
      estimate_(settings.estimator, settings.clocks, Span::from_seconds(settings.deadline_ms * 1e-3).ns) {
  known_ = known_next_ = knowledge_of(estimate_);
  if (settings.images) {
    track_ = std::make_unique<FrontEnd>(Camera(settings.camera), settings.tracker, settings.estimator.extrinsics.R_BC);
  }
}

bool OfflinePipeline::add_imu(ImuSample& sample) noexcept {
  const bool taken = imu_gate_.step(sample);
  imu_events_.after(taken, sample, imu_gate_);
  if (!taken) return false;
  if (track_) queue(imu_to_track_, sample, track_feed_, *track_);
  queue(imu_to_estimate_, sample, estimate_feed_, estimate_);
  return true;
}

HostStamp OfflinePipeline::imu_needed_until(HostStamp image) const noexcept {
  const HostStamp estimator_needs = estimate_.imu_needed_until(image);
  return track_ ? std::max(estimator_needs, tracker_needs(image)) : estimator_needs;
}

void OfflinePipeline::give(BackEnd& stage, const ImuSample& sample) noexcept {
  stage.add_imu(sample);
  estimator_events_.after_imu(sample, stage);
}

/// Between images that are far apart there are more readings than the ring holds: the stage gets the oldest early.
template <class Stage>
void OfflinePipeline::queue(ImuRing& ring, const ImuSample& sample, ImuFeed& feed, Stage& stage) noexcept {
  while (!ring.push(sample)) {
    feed.took(*ring.front());
    give(stage, *ring.front());
    ring.pop();
  }
}

/// The readings that belong before an image, as the stages in threads take them.
template <class Stage>
void OfflinePipeline::take_imu(ImuRing& ring, ImuFeed& feed, HostStamp needed, Stage& stage) noexcept {
  while (feed.wants_more(needed) && ring.front() != nullptr) {
    feed.took(*ring.front());
    give(stage, *ring.front());
    ring.pop();
  }
}

bool OfflinePipeline::admit(Frame& image) noexcept {
  const bool taken = image_gate_.step(image);
  image_events_.after(taken, image, image_gate_);
  return taken;
}

void OfflinePipeline::step(const Frame& image, FrameOutcome& out) noexcept {
  take_imu(imu_to_track_, track_feed_, tracker_needs(image.stamp), *track_);
  const StageTime began = clocks_.now();
  track_->set_knowledge(Vec3(known_.gyroscope_bias_rad_s.data()), known_.time_offset_s);
  track_->step(image, *tracked_);
  out.track = clocks_.now() - began;
  estimate(out);
}

void OfflinePipeline::step(const Frame& image, const TrackPoint* points, std::size_t count,
                           FrameOutcome& out) noexcept {
  recorded_.step(image.stamp, points, count, *tracked_);
  tracked_->reasons = image.reasons;
  out.track = {};
  estimate(out);
}

void OfflinePipeline::estimate(FrameOutcome& out) noexcept {
  take_imu(imu_to_estimate_, estimate_feed_, estimate_.imu_needed_until(tracked_->stamp), estimate_);
  const StepResult result = estimate_.step(*tracked_, BackEnd::kNoDeadline);
  known_ = std::exchange(known_next_, knowledge_of(estimate_));
  estimator_events_.after_image(*tracked_, estimate_);
  describe(*tracked_, result, estimate_, out);
  out.serial = serial_++;
}

}  // namespace epiline
