#include "pipeline/stages/offline.h"

namespace epiline {

OfflinePipeline::OfflinePipeline(const OfflineSettings& settings)
    : now_(settings.now),
      deadline_ns_(Span::from_seconds(settings.deadline_ms * 1e-3).ns),
      recorded_(Camera(settings.camera)),
      estimate_(settings.estimator, settings.now) {
  if (settings.images) {
    track_ =
        std::make_unique<TrackStage>(Camera(settings.camera), settings.tracker, settings.estimator.extrinsics.R_BC);
  }
}

void OfflinePipeline::add_imu(const ImuSample& sample) noexcept {
  if (track_) track_->add_imu(sample);
  estimate_.add_imu(sample);
}

OfflineStep OfflinePipeline::step(const Frame& image) noexcept {
  const std::int64_t began_ns = now_();
  track_->set_knowledge(estimator().gyroscope_bias(), estimator().odometry().time_offset_s);
  track_->step(image, *tracked_);
  const std::int64_t tracked_ns = now_();
  OfflineStep step = estimate(began_ns);
  step.track_ns = tracked_ns - began_ns;
  return step;
}

OfflineStep OfflinePipeline::step(HostStamp stamp, const TrackPoint* points, std::size_t count) noexcept {
  recorded_.step(stamp, points, count, *tracked_);
  return estimate(now_());
}

OfflineStep OfflinePipeline::estimate(std::int64_t began_ns) noexcept {
  OfflineStep step;
  step.result = estimate_.step(*tracked_, deadline_ns_ > 0 ? began_ns + deadline_ns_ : EstimateStage::kNoDeadline);
  step.estimate = estimate_.times();
  return step;
}

}  // namespace epiline
