#include "drivers/links/stream/odometry_gate.h"

namespace epiline {

Condition condition_of(const Health& health) noexcept {
  switch (health.state) {
    case HealthState::kTracking:
      return Condition::kGood;
    case HealthState::kDegraded:
      return Condition::kDegraded;
    case HealthState::kLost:
      return Condition::kLost;
    case HealthState::kInitialising:
      break;
  }
  return Condition::kWaiting;
}

bool OdometryGate::admits(const Odometry& odometry) noexcept {
  const Condition condition = condition_of(odometry.health);
  if (condition != Condition::kGood && condition != Condition::kDegraded) {
    stop();
    return false;
  }
  const std::int64_t stamp_us = odometry.stamp.ns / 1000;
  if (stamp_us <= newest_us_) return false;
  newest_us_ = stamp_us;
  const bool has_jumped = estimator_counter_ && *estimator_counter_ != odometry.reset_counter;
  if (has_jumped || has_stopped_) ++counter_;
  estimator_counter_ = odometry.reset_counter;
  has_stopped_ = false;
  return true;
}

}  // namespace epiline
