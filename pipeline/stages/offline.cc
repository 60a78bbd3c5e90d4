#include "pipeline/stages/offline.h"

#include <algorithm>

namespace epiline {

OfflinePipeline::OfflinePipeline(const OfflineSettings& s)
    : recorded_(s.recorded),
      clock_{s.clocks, &pace_},
      imu_(nullptr, {s.estimator.saturation_gyroscope_rad_s, s.estimator.saturation_accelerometer_m_s2},
           s.imu_correction, clock_,
           {s.images ? std::vector<ImuStage::Reader>{{&imu_to_track_, &nobody_}, {&imu_to_estimate_, &nobody_}}
                     : std::vector<ImuStage::Reader>{{&imu_to_estimate_, &nobody_}},
            unheard_, events_}),
      capture_(nullptr, clock_, {frames_, images_, nobody_, unheard_, events_}, apart_of(s.estimator)),
      estimate_({s.estimator, s.deadline_ms}, clock_,
                {tracked_, not_ended_, imu_to_estimate_, imu_ended_, speeds_, heights_},
                {knowledge_, nobody_, events_, nullptr, nullptr, s.log}),
      track_({s.camera, s.tracker, mount_of(s.estimator), s.images, recorded_, {}, lenses_of(s.others, s.estimator)},
             estimate_.knowledge(), clock_, {frames_, images_, not_ended_, imu_to_track_, imu_ended_, knowledge_},
             {tracked_, nobody_, events_}) {
  imu_ended_.set();
}

void OfflinePipeline::run() noexcept {
  while (track_.step().did == Step::Did::kWork || estimate_.step().did == Step::Did::kWork) {
  }
}

bool OfflinePipeline::add_imu(ImuSample& sample) noexcept {
  const bool taken = imu_.take(sample);
  run();  // between images that are far apart there are more readings than the rings hold
  return taken;
}

void OfflinePipeline::add_wheel(const WheelSample& sample) noexcept {
  speeds_.push(sample);
  run();
}

void OfflinePipeline::add_height(const HeightSample& sample) noexcept {
  heights_.push(sample);
  run();
}

HostStamp OfflinePipeline::imu_needed_until(HostStamp image) const noexcept {
  const HostStamp estimator_needs = estimate_.imu_needed_until(image);
  return track_.wants_imu() ? std::max(estimator_needs, track_.imu_needed_until(image)) : estimator_needs;
}

void OfflinePipeline::step(const Frame& image, const OtherFrames& others, FrameOutcome& out) noexcept {
  Frame numbered = image;
  numbered.slot = 0;
  while (images_.users(static_cast<std::size_t>(numbered.slot)) > 0) ++numbered.slot;  // each tracker may keep one
  capture_.hand_on(numbered, others);
  run();
  out = estimate_.outcome();
}

}  // namespace epiline
