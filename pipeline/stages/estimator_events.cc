#include "pipeline/stages/estimator_events.h"

#include <utility>

#include "pipeline/text/suspicion_text.h"

namespace epiline {

void EstimatorEvents::after_imu(const ImuSample& sample, const BackEnd& back_end) noexcept {
  const std::uint64_t aside = back_end.estimator().stats().imu_far_ahead;
  if (std::exchange(aside_, aside) != aside) return;  // no event until another sample confirms its timestamp
  const std::uint64_t gaps = back_end.estimator().stats().imu_gaps;
  if (std::exchange(gaps_, gaps) != gaps) tell(sample.stamp, EventId::kImuGap, (sample.stamp - last_imu_).ns);
  last_imu_ = sample.stamp;
}

void EstimatorEvents::after_image(const TrackedFrame& frame, const BackEnd& back_end) noexcept {
  const Odometry& o = back_end.odometry();
  if (back_end.times().late_ns > 0)
    tell(frame.stamp, EventId::kDeadlineMissed, frame.sequence, back_end.times().late_ns);
  const LoadLevel level = std::exchange(level_, back_end.times().load);
  if (level != level_) tell(frame.stamp, EventId::kLoadLevel, level, level_);
  if (std::exchange(resets_, o.reset_counter) != o.reset_counter) tell(frame.stamp, EventId::kReset, o.reset_counter);
  const bool started = (o.health.reasons & bit(HealthReason::kNoInitialState)) == 0;
  if (!std::exchange(started_, started) && started)
    tell(frame.stamp, EventId::kStarted, back_end.estimator().stats().start_kind);
  const Suspicions& suspicions = back_end.estimator().stats().suspicions;
  for (std::size_t i = 0; i < suspicions.size(); ++i) {
    if (std::exchange(severity_[i], suspicions[i].severity) == suspicions[i].severity) continue;
    out_.push(event_of(frame.stamp, static_cast<Suspect>(i), suspicions[i]));
  }
  const HealthState before = std::exchange(state_, o.health.state);
  if (before != o.health.state) tell(frame.stamp, EventId::kHealthChanged, before, o.health.state, o.health.reasons);
}

}  // namespace epiline
