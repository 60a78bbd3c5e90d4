#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"

namespace epiline {

namespace {
constexpr double kCarriedStep_s = 1;  // without a solved frame the IMU carries the state on in steps of this length
// A carried state is worth going on from while a few seconds of images can mend it; beyond, a start searches anew.
constexpr double kMostVelocity = 1, kMostTilt = 0.1;  // m/s, rad
}  // namespace

/// The newest state known, moved on to `time` by the readings. Without readings it stays where it is.
KnownState Estimator::Impl::carried_to(HostStamp time) const {
  KnownState s = carried;
  if (!s.known || time <= s.time) return s;
  Preintegration interval;
  interval.reset(s.x.b_a, s.x.b_g);
  if (!history.integrate(s.time, time, density, interval)) return s;
  s.P = carried_on(into_body(carried.P, carried.x.R), carried.x.R, interval);
  history.propagate(carried.time, time, s.x, s.omega);
  s.time = time;
  return s;
}

/// While no frame is solved the readings would be overwritten before they are needed.
void Estimator::Impl::carry_while_silent() {
  if (!carried.known || (history.newest().stamp - carried.time).seconds() < kCarriedStep_s) return;
  carried = carried_to(history.newest().stamp);
}

bool Estimator::Impl::may_go_on(const KnownState& s) const {
  if (!s.known || !s.trusted || !s.P.allFinite() || !s.x.p.allFinite() || !s.x.R.allFinite()) return false;
  return sigma_velocity(s.x, s.P) < kMostVelocity && sigma_tilt(s.x, s.P) < kMostTilt;
}

/// The window cannot be continued to this frame: a new one begins with it, from the carried state if that is good
/// enough, else by a search.
StepResult Estimator::Impl::start_anew(const TrackedFrame& frame, Supervisor& supervisor) {
  const bool running = started;
  const KnownState s = carried_to(imu_time(frame.stamp));
  if (running && s.time == imu_time(frame.stamp) && may_go_on(s)) {
    forget();
    carried = s;
    go_on_from_carried(frame);
    return {true, true, false};
  }
  reset();
  carried = s;
  return running ? StepResult{} : initialise(frame, supervisor);
}

void Estimator::Impl::go_on_from_carried(const TrackedFrame& frame) {
  cut(frame);
  Slot& slot = window.newest();
  slot.x = carried.x;
  slot.omega = carried.omega;
  set_prior(window, carried.P, calibration_sigmas());
  began(StartKind::kCarried);
  ++stats.carried_starts;
  publish(frame.stamp, carried);
  odometry.health = {};
  odometry.health.reasons = bit(HealthReason::kPosteriorWide);
}

/// Forgets all but the carried state and the calibration, on whose clock it stands.
void Estimator::Impl::forget() {
  window.clear();
  visual->restart();
  rest.clear();
  monitor.restart();
  started = resting = rejected_last = false;
  pixel_sigma = config.pixel_sigma;
  rest_frame = forced_keyframe = 0;
  odometry.health = {HealthState::kInitialising, bit(HealthReason::kNoInitialState), 0};
}

void Estimator::Impl::reset() {
  window.calibration = {config.extrinsics.time_offset_s, config.extrinsics.R_BC, config.extrinsics.p_BC};
  if (started) {
    ++stats.resets;
    ++odometry.reset_counter;
  }
  forget();
}

}  // namespace epiline
