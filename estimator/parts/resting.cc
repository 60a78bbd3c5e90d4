#include "estimator/parts/resting.h"

#include <algorithm>
#include <cmath>

#include "estimator/initialise/start_problem.h"

namespace epiline {

namespace {
// Off what a standing vehicle should read, and for how long: a tenth of it would be seen in the images by then.
constexpr double kRestRate = 0.01, kRestForce = 0.25, kContradicted_s = 0.5;  // rad/s, m/s^2
constexpr double kAhead = 0.2;                                                // of that time
constexpr double kStandingVelocity = 0.02;  // m/s: a vehicle that stands, and is not shaken, seems slower
constexpr double kDoubtedVelocity = 0.05, kShakingVelocity = 0.1;  // m/s: shaken, it may move; it has left
constexpr double kDeadReckoned_s = 2;
constexpr double kStood_s = 1;                             // a hover seems to stand for less
constexpr double kUnseen_m = 0.15, kShakenUnseen_m = 0.3;  // no such way while images stand still
constexpr double kCompared_s = 0.35;                       // that they look back at least
}  // namespace

void Resting::begin() {
  const Slot& newest = common_.window.newest();
  memory_.stood_at = memory_.images_still_since = newest.time;
  memory_.stood = newest.x.R;
}

void Resting::begin_at_rest() {
  memory_ = {};
  begin();
  const Slot& newest = common_.window.newest();
  images_.assume_rest(newest.x.R * common_.window.calibration.R_BC);
  memory_.reference = images_.reference();
  memory_.frame = newest.id;
  memory_.frame_held = true;
}

void Resting::forget() {
  images_.clear();
  memory_ = {};
}

void Resting::watch(const TrackedFrame& frame, double pixel_sigma) {
  images_.update(frame, pixel_sigma, 0, {Mat3::Identity(), common_.noise.shakes()});
}

/// At rest the mean readings give attitude and gyroscope bias at once. The images say that nothing moves: the readings
/// may shake.
std::optional<ImuStatistics> Resting::at_rest(WheelMotion wheels) const {
  const ImuStatistics read = readings_.statistics();
  if (!images_.images_calm() || !readings_.is_filled(read) || wheels == WheelMotion::kTurn) return std::nullopt;
  const bool may_shake = is_of_newest_frame(read) && (common_.noise.shakes() || wheels == WheelMotion::kStand);
  if (!may_shake && !readings_.is_stationary(read)) return std::nullopt;
  return read;
}

bool Resting::is_seen() const {
  const Slot& newest = common_.window.newest();
  return newest.at_rest && images_.images_still() && (newest.image_stamp - images_.reference()).seconds() > kStood_s;
}

bool Resting::is_restless() const {
  const ImuStatistics read = readings_.statistics();
  return readings_.is_filled(read) && !readings_.is_stationary(read);
}

/// Whether the readings since the vehicle last stood still have taken it away: images do not show that at once, and of
/// one that shakes not plainly, but shaking has no direction. A way that images would have shown was none: after a blow
/// the sensors read nonsense.
bool Resting::has_left() const {
  const Slot& newest = common_.window.newest();
  const bool shakes = common_.noise.shakes();
  const double most = shakes ? kShakingVelocity : kStandingVelocity;
  NavState x = newest.x;  // whose biases fit the scales of now
  if ((newest.time - memory_.stood_at).seconds() >= kDeadReckoned_s) {
    if (images_.attitude_held()) return false;
    x.p = kCompared_s * x.v;
  } else {
    x.R = memory_.stood;
    x.p.setZero();
    x.v.setZero();
    Vec3 omega;
    common_.history.propagate(memory_.stood_at, newest.time, common_.window.calibration.scale, x, omega);
  }
  const double unseen_m = shakes ? kShakenUnseen_m : kUnseen_m;
  return x.v.norm() > most && !(images_.images_still() && x.p.norm() > unseen_m);
}

/// What was called rest later than that was none.
void Resting::forget_rest(HostStamp after) {
  Window& window = common_.window;
  for (int k = window.size() - 1; k >= 0 && window.at(k).time > after; --k) {
    window.at(k).at_rest = false;
    window.at(k).rest_link = 0;
  }
}

bool Resting::is_new_place() const {
  return images_.reference() != memory_.reference || common_.window.index_of(memory_.frame) < 0;
}

void Resting::attach(const TrackedFrame& frame, double pixel_sigma, WheelMotion wheels) {
  Window& window = common_.window;
  const int n = window.size();
  Slot& newest = window.newest();
  const double rate = n > 1 ? common_.history.mean_rate(window.at(n - 2).time, newest.time, newest.x.b_g) : 0;
  using Verdict = RestDetector::Verdict;
  const Verdict found =
      images_.update(frame, pixel_sigma, rate, {newest.x.R * window.calibration.R_BC, common_.noise.shakes()});
  if (!images_.images_still()) memory_.images_still_since = newest.time;
  if (images_.was_drift()) forget_rest(HostStamp{});
  const bool stands = found != Verdict::kMoves, shaken = found == Verdict::kIsShaken;
  if (!common_.config.zero_motion || n < 2 || is_blind(frame.reasons)) return;
  if ((shaken && is_new_place()) || wheels == WheelMotion::kTurn) return;
  if ((stands || window.at(n - 2).at_rest) && wheels != WheelMotion::kStand && has_left()) {
    forget_rest(memory_.stood_at);
    images_.leave();
    return;
  }
  if (!stands) return;
  if (is_new_place()) {
    memory_.reference = images_.reference();
    memory_.frame = window.at(n - 2).id;
    memory_.frame_held = images_.attitude_held();
  }
  newest.at_rest = true;
  newest.shaken = shaken;
  newest.attitude_held = memory_.frame_held && !shaken && images_.attitude_held();
  newest.rest_link = memory_.frame;
  ++common_.stats.zero_motion_frames;
}

void Resting::solved() {
  const Window& window = common_.window;
  const Slot& old = window.at(std::max(0, window.size() - 1 - kRecentFrames));
  if (!old.attitude_held) return;
  memory_.stood = old.x.R;
  memory_.stood_at = old.time;
}

/// Whether the readings of half a second, up to the last one, are not ahead of the images.
bool Resting::is_of_newest_frame(const ImuStatistics& read) const {
  return read.count > 0 &&
         (common_.history.newest().stamp - common_.window.newest().time).seconds() < kAhead * read.duration_s;
}

bool Resting::is_contradicted(double dt_s) {
  double& since_s = memory_.contradicted_s;
  if ((common_.window.newest().time - memory_.images_still_since).seconds() < kContradicted_s) {
    since_s = 0;
    return false;
  }
  const NavState& x = common_.carried.x;
  const ImuStatistics read = readings_.statistics();
  const RestBiases b = biases_at_rest(read, common_.window.calibration.scale, x.R);
  const bool fits = (b.b_g - x.b_g).norm() < std::max(kRestRate, 4 * b.sigma_b_g) &&
                    (b.b_a - x.b_a).norm() < std::max(kRestForce, 4 * b.sigma_b_a);
  since_s = is_of_newest_frame(read) && !fits ? since_s + dt_s : 0;
  return since_s > kContradicted_s;
}

StateCovariance Resting::doubt_of_leaving() const {
  const Vec3& v = common_.carried.x.v;
  const double most = common_.noise.shakes() ? kDoubtedVelocity : kStandingVelocity;
  if (!images_.images_still() || common_.window.index_of(memory_.frame) < 0 || v.norm() < most)
    return StateCovariance::Zero();
  Eigen::Matrix<double, 16, 1> moved = Eigen::Matrix<double, 16, 1>::Zero();
  const double since_s = (common_.carried.time - std::max(memory_.stood_at, memory_.images_still_since)).seconds();
  moved.head<3>() = 0.5 * std::min(since_s, kDeadReckoned_s) * v;
  moved.segment<3>(6) = v;
  return moved * moved.transpose();
}

std::optional<RestBiases> Resting::biases() const {
  const ImuStatistics read = readings_.statistics();
  if (std::abs(read.mean_specific_force.norm() - kGravity) > kForceTolerance) return std::nullopt;
  return biases_at_rest(read, common_.window.calibration.scale, common_.carried.x.R);
}

}  // namespace epiline
