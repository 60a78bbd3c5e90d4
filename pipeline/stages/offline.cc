#include "pipeline/stages/offline.h"

namespace epiline {

OfflinePipeline::OfflinePipeline(const OfflineSettings& settings)
    : clocks_(settings.clocks),
      imu_gate_({settings.estimator.saturation_gyroscope_rad_s, settings.estimator.saturation_accelerometer_m_s2}),
      recorded_(Camera(settings.camera)),
      estimate_(settings.estimator, settings.clocks, Span::from_seconds(settings.deadline_ms * 1e-3).ns) {
  if (settings.images) {
    track_ =
        std::make_unique<TrackStage>(Camera(settings.camera), settings.tracker, settings.estimator.extrinsics.R_BC);
  }
}

bool OfflinePipeline::add_imu(ImuSample& sample) noexcept {
  const bool taken = imu_gate_.step(sample);
  imu_events_.after(taken, sample, imu_gate_);
  if (!taken) return false;
  if (track_) track_->add_imu(sample);
  estimate_.add_imu(sample);
  estimator_events_.after_imu(sample, estimate_);
  return true;
}

bool OfflinePipeline::admit(Frame& image) noexcept {
  const bool taken = image_gate_.step(image);
  image_events_.after(taken, image, image_gate_);
  return taken;
}

void OfflinePipeline::step(const Frame& image, FrameOutcome& out) noexcept {
  const StageTime began = clocks_.now();
  track_->set_knowledge(estimator().gyroscope_bias(), estimator().odometry().time_offset_s);
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
  const StepResult result = estimate_.step(*tracked_, EstimateStage::kNoDeadline);
  estimator_events_.after_image(*tracked_, estimate_);
  describe(*tracked_, result, estimate_, out);
  out.serial = serial_++;
}

}  // namespace epiline
