#include "pipeline/stages/estimator_events.h"

#include <utility>

namespace epiline {

void EstimatorEvents::after_imu(const ImuSample& sample, const EstimateStage& stage) noexcept {
  const EstimatorStats& stats = stage.estimator().stats();
  const auto refused = [&](std::uint64_t& known, std::uint64_t count, ImuRefusal reason) {
    if (std::exchange(known, count) == count) return false;
    tell(sample.stamp, EventId::kImuRefused, static_cast<std::int64_t>(reason));
    return true;
  };
  if (refused(out_of_order_, stats.imu_out_of_order, ImuRefusal::kOutOfOrder)) return;
  if (refused(duplicate_, stats.imu_duplicate, ImuRefusal::kDuplicate)) return;
  if (refused(not_finite_, stats.imu_not_finite, ImuRefusal::kNotFinite)) return;
  if (std::exchange(gaps_, stats.imu_gaps) != stats.imu_gaps)
    tell(sample.stamp, EventId::kImuGap, (sample.stamp - last_imu_).ns);
  last_imu_ = sample.stamp;
}

void EstimatorEvents::after_image(const TrackedFrame& frame, const EstimateStage& stage) noexcept {
  const Odometry& o = stage.odometry();
  if (stage.times().late_ns > 0)
    tell(frame.stamp, EventId::kDeadlineMissed, static_cast<std::int64_t>(frame.sequence), stage.times().late_ns);
  const LoadLevel level = std::exchange(level_, stage.times().load);
  if (level != level_)
    tell(frame.stamp, EventId::kLoadLevel, static_cast<std::int64_t>(level), static_cast<std::int64_t>(level_));
  if (std::exchange(resets_, o.reset_counter) != o.reset_counter) tell(frame.stamp, EventId::kReset, o.reset_counter);
  const bool started = (o.health.reasons & static_cast<std::uint32_t>(HealthReason::kNoInitialState)) == 0;
  if (!std::exchange(started_, started) && started)
    tell(frame.stamp, EventId::kStarted, static_cast<std::int64_t>(stage.estimator().stats().start_kind));
  const HealthState before = std::exchange(state_, o.health.state);
  if (before != o.health.state) {
    tell(frame.stamp, EventId::kHealthChanged, static_cast<std::int64_t>(before),
         static_cast<std::int64_t>(o.health.state), o.health.reasons);
  }
}

}  // namespace epiline
