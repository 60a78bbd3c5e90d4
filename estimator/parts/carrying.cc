#include "estimator/parts/carrying.h"

#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"

namespace epiline {

namespace {
constexpr double kCarriedStep_s = 1;  // without a solved frame the IMU carries the state on in steps of this length
// A carried state is worth going on from while a few seconds of images can mend it; beyond, a start searches anew.
constexpr double kMostVelocity = 1, kMostTilt = 0.1;  // m/s, rad
// Without images that long, errors add up that images otherwise hold down: scale and axes of the sensors, and what the
// window's covariance claims too little. Both as factors of standard deviations (docs/developers/decisions.md#silence).
constexpr double kSilentState = 1.6, kSilentReadings = 1.6;

ImuHistory::Density widened(ImuHistory::Density density) {
  density.noise.accelerometer_density *= kSilentReadings;
  density.noise.accelerometer_random_walk *= kSilentReadings;
  return density;
}

/// Covariance of a state with the calibration, at the end of an interval that begins at that state, whose attitude was
/// `R_WB`.
CrossCovariance carried_on(const CrossCovariance& from, const Mat3& R_WB, const Preintegration& interval) {
  Mat15 B = Mat15::Identity();  // into the axes of the body, in which the interval is
  B.block<3, 3>(0, 0) = B.block<3, 3>(6, 6) = R_WB.transpose();
  CrossCovariance to = from;
  to.topRows<15>() = B.transpose() * (interval.J * (B * from.topRows<15>()));
  return to;
}
}  // namespace

/// Whether forces tell nothing of the motion since a state: readings are missing, or nobody knows how much of
/// them is gravity.
bool Carrying::forces_are_unknown(const KnownState& from, HostStamp until) const {
  if (intervals_.is_silent(from.time, until)) return true;
  return !common_.started && sigma_tilt(from.x, from.P) > kMostTilt;
}

KnownState Carrying::on_to(const KnownState& from, HostStamp time) const {
  KnownState s = from;
  if (!s.known || time <= s.time) return s;
  const Window& window = common_.window;
  const ImuHistory& history = common_.history;
  const ImuHistory::Density& density = common_.noise.of_intervals();
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

KnownState Carrying::predicted_newest() const {
  const KnownState& carried = common_.carried;
  const Slot& newest = common_.window.newest();
  if (carried.time != common_.window.at(common_.window.size() - 2).time)  // an IMU that outlasts the camera
    return to(newest.time);
  const Mat3& R = carried.x.R;
  return {true,         carried.trusted,
          newest.time,  newest.x,
          newest.omega, carried_on(into_body(carried.P, R), R, newest.imu),
          false,        carried_on(carried.with_calibration, R, newest.imu)};
}

void Carrying::keep_up() {
  KnownState& carried = common_.carried;
  const HostStamp newest = common_.history.newest().stamp;
  if (!carried.known || (newest - carried.time).seconds() < kCarriedStep_s) return;
  from_ = carried;
  carried = to(newest);
}

bool may_go_on(const KnownState& s) {
  if (!s.known || !s.trusted || !s.P.allFinite() || !s.x.p.allFinite() || !s.x.R.allFinite()) return false;
  return sigma_velocity(s.x, s.P) < kMostVelocity && sigma_tilt(s.x, s.P) < kMostTilt;
}

}  // namespace epiline
