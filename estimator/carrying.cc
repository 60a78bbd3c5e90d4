#include <algorithm>

#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"
#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
constexpr int kSeenAgain = 20;        // tracks that tie an image after a silence to the window before it
constexpr double kCarriedStep_s = 1;  // without a solved frame the IMU carries the state on in steps of this length
// A carried state is worth going on from while a few seconds of images can mend it; beyond, a start searches anew.
constexpr double kMostVelocity = 1, kMostTilt = 0.1;  // m/s, rad
// Without images that long, errors add up that images otherwise hold down: scale and axes of the sensors, and what the
// window's covariance claims too little. Both as factors of standard deviations (docs/developers/decisions.md#silence).
constexpr double kSilence_s = 0.5, kSilentState = 1.6, kSilentReadings = 1.6;

// Of a vehicle: while only images show how it moves, its way of flying says nothing.
constexpr double kAnyAcceleration = 30, kAnyRate = 10;  // m/s^2, rad/s

ImuHistory::Density widened(ImuHistory::Density density) {
  density.noise.accelerometer_density *= kSilentReadings;
  density.noise.accelerometer_random_walk *= kSilentReadings;
  return density;
}
}  // namespace

/// The interval between two images without readings: turning and moving as before.
void Estimator::Impl::coast(const Slot& from, double T, Preintegration& interval) const {
  const double rate = kAnyRate * T, walk_a = density.noise.accelerometer_random_walk,
               walk_g = density.noise.gyroscope_random_walk;
  interval.T = T;
  interval.dR = so3_exp(T * (from.omega - from.x.b_g));
  interval.dv = from.x.R.transpose() * (-kGravity_W * T);
  interval.dp = 0.5 * T * interval.dv;
  interval.C.block<3, 3>(3, 3) = rate * rate * Mat3::Identity();
  interval.C.block<3, 3>(9, 9) = walk_a * walk_a * T * Mat3::Identity();
  interval.C.block<3, 3>(12, 12) = walk_g * walk_g * T * Mat3::Identity();
  interval.forget_forces(kAnyAcceleration);
}

bool Estimator::Impl::is_silent(HostStamp from, HostStamp to) const {
  return history.longest_unknown_s(from, to) > kLongestUnknown_s;
}

/// Whether an image tells where the vehicle is while the IMU is silent: one that stood has not seen how far anything
/// is, and its motion would have no scale.
bool Estimator::Impl::images_suffice(const TrackedFrame& frame) const {
  if (!started || seen_again(frame) < kSeenAgain) return false;
  return depth_known || window.newest().at_rest;
}

/// The interval between two frames. While the IMU is silent, only images show how the vehicle moves.
bool Estimator::Impl::integrate(const Slot& from, Slot& to) const {
  to.silent = is_silent(from.time, to.time);
  if (!to.silent) {
    const bool whole = history.integrate(from.time, to.time, density, to.imu);
    to.imu.doubt_forces(to.unknown_acceleration);
    return whole;
  }
  coast(from, (to.time - from.time).seconds(), to.imu);
  return true;
}

CrossCovariance carried_on(const CrossCovariance& from, const Mat3& R_WB, const Preintegration& interval) noexcept {
  Mat15 B = Mat15::Identity();  // into the axes of the body, in which the interval is
  B.block<3, 3>(0, 0) = B.block<3, 3>(6, 6) = R_WB.transpose();
  CrossCovariance to = from;
  to.topRows<15>() = B.transpose() * (interval.J * (B * from.topRows<15>()));
  return to;
}

/// Whether forces tell nothing of the motion since a state: readings are missing, or nobody knows how much of
/// them is gravity.
bool Estimator::Impl::forces_are_unknown(const KnownState& from, HostStamp until) const {
  if (is_silent(from.time, until)) return true;
  return !started && sigma_tilt(from.x, from.P) > kMostTilt;
}

/// A state moved on to `time` by the readings. Without readings it stays where it is.
KnownState Estimator::Impl::carried_on_to(const KnownState& from, HostStamp time) const {
  KnownState s = from;
  if (!s.known || time <= s.time) return s;
  Preintegration interval;
  interval.reset(s.x.b_a, s.x.b_g, window.calibration.scale);
  const bool silent = s.silent || (time - s.time).seconds() > kSilence_s;
  if (!history.integrate(s.time, time, silent ? widened(density) : density, interval)) return s;
  if (silent && !s.silent) widen(s.x, kSilentState * kSilentState, s.P);
  s.silent = silent;
  history.propagate(from.time, time, window.calibration.scale, s.x, s.omega);
  if (window.size() > 0 && interval.T < kLongestUnknown_s)  // what contradicted a moment ago may still do so
    interval.doubt_forces(window.newest().unknown_acceleration);
  if (forces_are_unknown(from, time)) {
    interval.forget_forces(density.gap_acceleration);
    s.x.p = from.x.p + interval.T * from.x.v;
    s.x.v = from.x.v;
  }
  s.P = carried_on(into_body(s.P, from.x.R), from.x.R, interval);
  s.with_calibration = carried_on(s.with_calibration, from.x.R, interval);
  s.time = time;
  return s;
}

/// While no frame is solved the readings would be overwritten before they are needed.
void Estimator::Impl::carry_while_silent() {
  if (!carried.known || (history.newest().stamp - carried.time).seconds() < kCarriedStep_s) return;
  carried_from = carried;
  carried = carried_to(history.newest().stamp);
}

bool Estimator::Impl::may_go_on(const KnownState& s) const {
  if (!s.known || !s.trusted || !s.P.allFinite() || !s.x.p.allFinite() || !s.x.R.allFinite()) return false;
  return sigma_velocity(s.x, s.P) < kMostVelocity && sigma_tilt(s.x, s.P) < kMostTilt;
}

/// Begins a new window at this frame with the carried state. False, and nothing happens, if that is not good enough.
bool Estimator::Impl::go_on(const TrackedFrame& frame) {
  const KnownState s = carried_to(imu_time(frame.stamp));
  if (!started || s.time != imu_time(frame.stamp) || !may_go_on(s)) return false;
  const double pixels = pixel_sigma, drift = drift_sigma;
  forget();
  pixel_sigma = pixels;
  drift_sigma = drift;
  carried = s;
  carried.silent = false;
  go_on_from_carried(frame);
  return true;
}

/// How much of what the window has seen an image shows, tracks.
int Estimator::Impl::seen_again(const TrackedFrame& frame) const {
  const auto known = [this](const TrackedFeature& f) { return window.find(f.id) >= 0; };
  auto n = std::count_if(frame.features.begin(), frame.features.end(), known);
  for (const OtherTracks& other : frame.others) n += std::count_if(other.alone.begin(), other.alone.end(), known);
  return static_cast<int>(n);
}

/// After a silence of the camera the old window has nothing to say to what the images show now, but for the state that
/// the IMU has carried on, and that claims too little in the window.
bool Estimator::Impl::go_on_after_silence(const TrackedFrame& frame) {
  const double silent_s = (frame.stamp - window.newest().image_stamp).seconds();
  return silent_s > kSilence_s && seen_again(frame) < kSeenAgain && go_on(frame);
}

/// The window cannot be continued to this frame: a new one begins with it, from the carried state if that is good
/// enough, else by a search.
StepResult Estimator::Impl::start_anew(const TrackedFrame& frame, Supervisor& supervisor) {
  const bool running = started;
  if (go_on(frame)) return {true, true};
  const KnownState s = carried_to(imu_time(frame.stamp));
  reset();
  carried = s;
  return running ? StepResult{} : initialise(frame, supervisor);
}

void Estimator::Impl::go_on_from_carried(const TrackedFrame& frame) {
  cut(frame);
  Slot& slot = window.newest();
  slot.x = carried.x;
  slot.omega = carried.omega;
  set_prior(window,
            {carried.P, calibration_covariance, carried.with_calibration, calibration_sigmas()[kTimeOffsetColumn]});
  began(StartKind::kCarried);
  ++stats.carried_starts;
  publish(frame.stamp, carried);
  odometry.health = {};
  odometry.health.reasons = bit(HealthReason::kPosteriorWide);
}

/// Forgets all but the carried state and the calibration, on whose clock it stands.
void Estimator::Impl::forget() {
  window.clear();
  starter.forget();
  visual->restart();
  rest.clear();
  monitor.restart();
  started = rejected_last = start_lacks_time = may_slide = false;
  pixel_sigma = config.pixel_sigma;
  drift_sigma = kUsualDrift;
  rethinking_s = after_silence_s = after_refusal_s = 0;
  height_memory = {};
  rest_frame = 0;
  rest_reference = {};
  accelerometer_walk.restart();
  gyroscope_walk.restart();
  rest_contradicted_s = 0;
  depth_known = false;
  odometry.health = {HealthState::kInitialising, bit(HealthReason::kNoInitialState), 0};
}

void Estimator::Impl::reset() {
  calibration_covariance.setZero();
  window.calibration = configured_calibration();
  if (contradictions.numbers_fitted()) monitor.forgive();
  contradictions.restart();
  if (started) {
    ++stats.resets;
    ++odometry.reset_counter;
  }
  forget();
}

}  // namespace epiline
