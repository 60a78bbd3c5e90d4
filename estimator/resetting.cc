#include <algorithm>

#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/initialise/stationary_start.h"

namespace epiline {

namespace {
constexpr double kSilence_s = 0.5;  // of the camera: after a longer one the old window says nothing of what is seen
}  // namespace

/// Whether an image tells where the vehicle is while the IMU is silent: one that stood has not seen how far anything
/// is, and its motion would have no scale.
bool Estimator::Impl::images_suffice(const TrackedFrame& frame) const {
  if (!started || seen_again(frame) < kSeenAgain) return false;
  return flight.depth_known || window.newest().at_rest;
}

/// Begins a new window at this frame with the carried state. False, and nothing happens, if that is not good enough.
bool Estimator::Impl::go_on(const TrackedFrame& frame) {
  const KnownState s = carrying.to(imu_time(frame.stamp));
  if (!started || s.time != imu_time(frame.stamp) || !may_go_on(s)) return false;
  const TrackNoise tracks = flight.tracks;
  forget();
  flight.tracks = tracks;
  carried = s;
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
  carried = carrying.to(imu_time(frame.stamp));
  reset();
  return running ? StepResult{} : initialise(frame, supervisor);
}

void Estimator::Impl::go_on_from_carried(const TrackedFrame& frame) {
  cut(frame);
  Slot& slot = window.newest();
  slot.x = carried.x;
  slot.omega = carried.omega;
  set_prior(window, {carried.P - carrying.doubt_of_calibration(carried.with_calibration), calibration_covariance,
                     carried.with_calibration, prior_information, calibration_sigmas()[kTimeOffsetColumn]});
  began(StartKind::kCarried);
  ++stats.carried_starts;
  publish(frame.stamp, carried);
}

/// The vehicle is where it was; its biases are what it reads. A force beyond any bias is that of a lift: a start waits
/// for its end.
StepResult Estimator::Impl::begin_anew_at_rest(const TrackedFrame& frame) {
  const auto at_rest = resting.biases();
  if (!at_rest) {
    reset();
    return {};
  }
  carried.x.v.setZero();
  carried.x.b_a = at_rest->b_a;
  carried.x.b_g = at_rest->b_g;
  carried.P = covariance_at_rest(*at_rest, carried.x.R, carried.P);
  carried.with_calibration.setZero();
  ++stats.resets;
  ++odometry.reset_counter;
  forget();
  go_on_from_carried(frame);
  return {true, true};
}

/// Forgets all but the carried state and the calibration, on whose clock it stands.
void Estimator::Impl::forget() {
  window.clear();
  started = false;
  flight = Flight(config);
  attempt = {};
  starter.forget();
  visual->restart();
  resting.forget();
  heights.forget();
  noise.restart();
  monitor.restart();
}

void Estimator::Impl::reset() {
  calibration_covariance.setZero();
  calibration_doubt.setZero();
  carried.with_calibration.setZero();
  window.calibration = configured_calibration();
  if (numbers.have_fitted()) monitor.forgive();
  numbers.restart();
  if (started) {
    ++stats.resets;
    ++odometry.reset_counter;
  }
  forget();
}

}  // namespace epiline
