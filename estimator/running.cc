#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/factors/calibration_prior.h"
#include "estimator/factors/imu.h"
#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/initialise/stationary_start.h"
#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"
#include "estimator/predict/moved_in_time.h"
#include "estimator/window/choose_tracks.h"
#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
constexpr double kMountElsewhere = 0.17;  // rad
// Beyond, the biases' first-order corrections are worth little, and the readings may be gone.
constexpr double kLongestInterval_s = 5;
constexpr double kLongRest_s = 2;     // over which the IMU loses less of the velocity than rest tells
constexpr double kYoungWindow_s = 2;  // more solver steps until the window has seen this much
constexpr int kStepsOfYoung = 3;      // solver steps of an image then, and after a rejected step: the state is far off
constexpr double kGateFree_s = 1;     // no gate until then: a young state may be far off
constexpr double kReintegrateAccelerometer = 0.1, kReintegrateGyroscope = 0.01;  // m/s^2, rad/s
constexpr double kReintegrateScale = 0.005;                                      // relative
// Off what a standing vehicle should read, and for how long: a tenth of it would be seen in the images by then.
constexpr double kRestRate = 0.01, kRestForce = 0.25, kRestContradicted_s = 0.5;        // rad/s, m/s^2
constexpr double kAhead = 0.2;                                                          // of that time
constexpr double kLeavingVelocity = 0.05, kShakingVelocity = 0.1, kDeadReckoned_s = 2;  // m/s, m/s, s
constexpr double kStandingVelocity = 0.02;  // m/s: a vehicle that stands, and is not shaken, seems slower
constexpr double kLiftAcceleration = 3, kBlowAcceleration = 30;  // m/s^2: what stands behind forces that don't fit
constexpr int kDoubtedIntervals = 4;                             // the newest: older ones have been judged before
constexpr double kDepthKnown_px = 10;                            // parallax: the images have a scale to a tenth
constexpr double kTimeOffsetWalk = 1e-5;                         // s/sqrt(s)
constexpr double kRethinking_s = 1;  // until the window has moved to a calibration that is far off
constexpr double kSigmaMemory_s = 10;
constexpr double kDriftLeast = 0.02;  // px per root of an image

bool is_finite(const KnownState& s) {
  const NavState& x = s.x;
  return x.p.allFinite() && x.v.allFinite() && x.R.allFinite() && x.b_a.allFinite() && x.b_g.allFinite() &&
         s.P.allFinite();
}

FoundCalibration found(const Calibration& c, const CalibrationTangent& variances) {
  const Eigen::Quaterniond q(c.R_BC);
  FoundCalibration f{true,
                     c.time_offset,
                     {q.w(), q.x(), q.y(), q.z()},
                     {c.p_BC.x(), c.p_BC.y(), c.p_BC.z()},
                     c.focal_ratio(),
                     c.scale.accelerometer,
                     c.scale.gyroscope,
                     {}};
  Eigen::Map<CalibrationTangent>(f.sigmas.data()) = variances.cwiseSqrt();
  return f;
}

/// Whether frame k is where a rest ended, and the velocity of what follows would hang on a frame of seconds before.
bool ends_long_rest(const Window& window, int k) {
  for (int later = k + 1; later < window.size(); ++later)
    if (window.at(later).at_rest) return false;
  return window.at(k).at_rest && window.at(k).imu.T > kLongRest_s;
}

/// What was called rest later than that was none.
void forget_rest(Window& window, HostStamp after) {
  for (int k = window.size() - 1; k >= 0 && window.at(k).time > after; --k) {
    window.at(k).at_rest = false;
    window.at(k).rest_link = 0;
  }
}

}  // namespace

/// What the window knows was concluded under a rotation of the camera that is now known to be far off.
bool Estimator::Impl::mount_is_elsewhere() const {
  return so3_log(began_R_BC.transpose() * window.calibration.R_BC).norm() > kMountElsewhere;
}

/// One frame that is solved: its window is cut from the stream, predicted, given its measurements, solved, judged and
/// published.
StepResult Estimator::Impl::step(const TrackedFrame& frame, Supervisor& supervisor, const Supervisor::Effort& effort) {
  const double dt_s = (frame.stamp - window.newest().image_stamp).seconds();
  const KnownState last = carried;
  // what contradicts numbers that have fitted is something that moves, or a blow
  const bool may_doubt = contradictions.numbers_fitted() && images_suffice(frame);
  if (!cut(frame)) return start_anew(frame, supervisor);
  const KnownState predicted = predicted_newest();
  attach(frame);
  SolverSummary s = solve(supervisor, effort);
  for (int i = 0; i < 2 && may_doubt && s.solved() && doubt_contradicted_forces(); ++i) s = solve(supervisor, effort);
  if (Slot& newest = window.newest(); newest.silent) {
    after_silence_s = kGateFree_s;
    newest.omega = so3_log(window.at(window.size() - 2).x.R.transpose() * newest.x.R) / dt_s + newest.x.b_g;
  }
  // State and covariance leave together: the solver's, or the IMU's prediction.
  carried = predicted;
  carried.x = window.newest().x;
  carried.silent = false;
  if (s.solved()) take_from_solver(predicted.x, dt_s);
  FrameEvidence evidence;
  evidence.overloaded = effort.reduced();
  evidence.innovation = innovation(predicted.x, predicted.P, carried.x);
  if (rest_is_contradicted(dt_s)) return begin_anew_at_rest(frame);
  judge(frame, s, evidence, dt_s);
  if (mount_is_elsewhere()) {
    const Calibration found = window.calibration;
    monitor.want_reset();
    carried.trusted = false;
    reset();
    window.calibration = found;
    return {};
  }
  if (monitor.reset_wanted()) {
    if (!is_finite(carried)) {  // a new start must have a place to be put
      carried = last;
      carried.trusted = false;
    }
    reset();
    return {};
  }
  publish(frame.stamp, carried);
  if (after_silence_s > 0) say(HealthReason::kImuGap);
  if (after_refusal_s > 0) say(HealthReason::kReadingsRefused);
  after_silence_s -= dt_s;
  after_refusal_s -= dt_s;
  if (s.solved() && effort.most_steps != 1)
    learn_from_residuals(s, dt_s);  // those of an untried step are those before it
  may_slide = true;
  return {true, true};
}

/// Forces of the last intervals that the images contradict are doubted, the more so the second time. Whether there are
/// any.
bool Estimator::Impl::doubt_contradicted_forces() {
  bool any = false;
  for (int k = std::max(1, window.size() - kDoubtedIntervals); k < window.size(); ++k) {
    Slot& slot = window.at(k);
    double& unknown = slot.unknown_acceleration;
    if (slot.silent || unknown >= kBlowAcceleration ||
        !intervals.contradicted(imu_chi2(window, k), window.at(k - 1).unknown_acceleration > 0))
      continue;
    unknown = unknown > 0 ? kBlowAcceleration : kLiftAcceleration;
    slot.imu.doubt_forces(unknown);
    whiten(slot);
    any = true;
  }
  if (any && !window.newest().at_rest) after_refusal_s = kGateFree_s;
  return any;
}

/// What the solver claims, with what it cannot know: other maxima of the calibration, and the shape of the lens.
void Estimator::Impl::take_from_solver(const NavState& predicted, double dt_s) {
  carried.P = solver.covariance();
  carried.with_calibration = solver.cross_covariance();
  calibration_covariance = solver.calibration_covariance();
  watch_wheels();
  learn_walks();
  if (const Slot& old = window.at(std::max(0, window.size() - 1 - kRecentFrames)); old.attitude_held) {
    stood = old.x.R;
    stood_at = old.time;
  }
  doubt_origin(predicted, dt_s);
  if (look_far(calibration_covariance, solver.linearised_at(), window.calibration, dt_s, window.calibration_prior))
    rethinking_s = kRethinking_s;
  if (window.size() > 1 && !window.newest().only_images()) {
    const double chi2 = imu_chi2(window, window.size() - 1);
    intervals.add(chi2, dt_s);
    if (const double factor = intervals.widens(chi2); factor > 1) widen(carried.x, factor, carried.P);
  }
  const Vec3 doubt = doubt_of_lens(window.calibration_prior, window.calibration, window.rig);
  carried.P += doubt_of_leaving() +
               covariance_between_maxima(window.calibration_prior, window.calibration, calibration_covariance,
                                         carried.with_calibration) +
               covariance_of_doubt(doubt, calibration_covariance, carried.with_calibration);
  CalibrationTangent variances = calibration_covariance.diagonal();
  variances.segment<3>(kFocalColumn) += doubt;
  stats.calibration = found(window.calibration, variances);
}

/// A window that finds its calibration far off moves: by as much was the origin wrong, which the start called exact.
void Estimator::Impl::doubt_origin(const NavState& predicted, double dt_s) {
  if (rethinking_s <= 0) return;
  rethinking_s -= dt_s;
  const NavState& x = carried.x;
  const double moved = (x.p - predicted.p).norm(), yaw = so3_log(x.R * predicted.R.transpose()).z();
  world.sigma_p = std::hypot(world.sigma_p, moved / std::sqrt(3));
  world.sigma_yaw = std::hypot(world.sigma_yaw, yaw);
}

/// The frame just cut, as the IMU predicts it.
KnownState Estimator::Impl::predicted_newest() const {
  const Slot& newest = window.newest();
  if (carried.time != window.at(window.size() - 2).time)  // an IMU that outlasts the camera
    return carried_to(newest.time);
  const Mat3& R = carried.x.R;
  return {true,         carried.trusted,
          newest.time,  newest.x,
          newest.omega, carried_on(into_body(carried.P, R), R, newest.imu),
          false,        carried_on(carried.with_calibration, R, newest.imu)};
}

/// Appends the frame, predicted by the IMU. False: there are no readings for it.
bool Estimator::Impl::cut(const TrackedFrame& frame) {
  reintegrate_revised();
  Slot cut;
  cut.image_stamp = frame.stamp;
  cut.time = imu_time(frame.stamp);
  cut.time_offset_used = (cut.time - frame.stamp).seconds();
  if (window.size() == 0) {
    history.propagate(cut.time, cut.time, window.calibration.scale, cut.x, cut.omega);
  } else {
    const Slot& last = window.newest();
    cut.x = last.x;
    cut.omega = last.omega;
    cut.imu.reset(last.x.b_a, last.x.b_g, window.calibration.scale);
    if (!integrate(last, cut)) return false;
    if (cut.silent) {
      cut.x.p += cut.imu.T * last.x.v;
      cut.x.R = so3_normalised(last.x.R * cut.imu.dR);
    } else {
      history.propagate(last.time, cut.time, window.calibration.scale, cut.x, cut.omega);
    }
  }
  Slot& s = window.append();
  cut.id = s.id;
  s = cut;
  const Window::Observed seen = window.observe(frame);
  stats.tracks_refused += static_cast<std::uint64_t>(seen.without_room);
  stats.features_refused += static_cast<std::uint64_t>(seen.impossible);
  return window.size() == 1 || whiten(s);
}

/// What else is known of the frame, and of those before it.
void Estimator::Impl::attach(const TrackedFrame& frame) {
  attach_rest(frame);
  attach_wheel();
  find_wheel_slips();
  attach_heights();
  reintegrate_moved_biases();
}

/// Whether the readings since the vehicle last stood still have taken it away: images of a far scene do not show that
/// at once, and of one that shakes not plainly, but shaking has no direction.
bool Estimator::Impl::has_left(bool shakes) const {
  const double most = shakes ? kShakingVelocity : kLeavingVelocity;
  const HostStamp now = window.newest().time;
  if (!shakes && window_age_s(now) < kGateFree_s) return false;
  if ((now - stood_at).seconds() >= kDeadReckoned_s) return !rest.attitude_held() && window.newest().x.v.norm() > most;
  NavState x = window.newest().x;  // whose biases fit the scales of now
  x.R = stood;
  x.v.setZero();
  Vec3 omega;
  history.propagate(stood_at, now, window.calibration.scale, x, omega);
  return x.v.norm() > most;
}

/// Zero motion (docs/derivations/zero_motion.md): at its first success in a place the candidate becomes a keyframe,
/// once, and later frames at rest there are tied to it.
void Estimator::Impl::attach_rest(const TrackedFrame& frame) {
  const int n = window.size();
  Slot& newest = window.newest();
  const double rate = n > 1 ? history.mean_rate(window.at(n - 2).time, newest.time, newest.x.b_g) : 0;
  using Verdict = RestDetector::Verdict;
  const bool shakes = noise_bounds.shakes(noise.accelerometer_density);
  const Verdict found = rest.update(frame, pixel_sigma, rate, {newest.x.R * window.calibration.R_BC, shakes});
  if (!rest.images_still()) images_still_since = newest.time;
  if (rest.was_drift()) forget_rest(window, HostStamp{});
  const bool shaken = found == Verdict::kIsShaken;
  const WheelMotion wheels = wheel_motion();
  if (!config.zero_motion || found == Verdict::kMoves || n < 2 || is_blind(frame.reasons)) return;
  if (shaken && (rest.reference() != rest_reference || window.index_of(rest_frame) < 0)) return;
  if (wheels == WheelMotion::kTurn) return;
  if (wheels != WheelMotion::kStand && has_left(shakes)) {
    forget_rest(window, stood_at);
    return;
  }
  if (rest.reference() != rest_reference || window.index_of(rest_frame) < 0) {
    rest_reference = rest.reference();
    rest_frame = window.at(n - 2).id;
    rest_frame_held = rest.attitude_held();
  }
  newest.at_rest = true;
  newest.shaken = shaken;
  newest.attitude_held = rest_frame_held && !shaken && rest.attitude_held();
  newest.rest_link = rest_frame;
  ++stats.zero_motion_frames;
}

/// Whether the readings of half a second, up to the last one, are not ahead of the images.
bool Estimator::Impl::is_of_newest_frame(const ImuStatistics& read) const {
  return read.count > 0 && (history.newest().stamp - window.newest().time).seconds() < kAhead * read.duration_s;
}

/// Whether a vehicle that stands has read for a while what its state does not explain: the biases have stepped, or what
/// it stands on moves. Longer than images need to show that it leaves.
bool Estimator::Impl::rest_is_contradicted(double dt_s) {
  if ((window.newest().time - images_still_since).seconds() < kRestContradicted_s) {
    rest_contradicted_s = 0;
    return false;
  }
  const ImuStatistics read = stationary.statistics();
  const RestBiases at_rest = biases_at_rest(read, window.calibration.scale, carried.x.R);
  const bool fits = (at_rest.b_g - carried.x.b_g).norm() < std::max(kRestRate, 4 * at_rest.sigma_b_g) &&
                    (at_rest.b_a - carried.x.b_a).norm() < std::max(kRestForce, 4 * at_rest.sigma_b_a);
  rest_contradicted_s = is_of_newest_frame(read) && !fits ? rest_contradicted_s + dt_s : 0;
  return rest_contradicted_s > kRestContradicted_s;
}

/// Readings take it away from a rest that the images still show: it leaves, or what it stands on moves.
StateCovariance Estimator::Impl::doubt_of_leaving() const {
  const Vec3& v = carried.x.v;
  const double most = noise_bounds.shakes(noise.accelerometer_density) ? kLeavingVelocity : kStandingVelocity;
  if (!rest.images_still() || window.index_of(rest_frame) < 0 || v.norm() < most) return StateCovariance::Zero();
  Eigen::Matrix<double, 16, 1> moved = Eigen::Matrix<double, 16, 1>::Zero();
  const double since_s = (carried.time - std::max(stood_at, images_still_since)).seconds();
  moved.head<3>() = 0.5 * std::min(since_s, kDeadReckoned_s) * v;
  moved.segment<3>(6) = v;
  return moved * moved.transpose();
}

/// The vehicle is where it was; its biases are what it reads. A force beyond any bias is that of a lift: a start waits
/// for its end.
StepResult Estimator::Impl::begin_anew_at_rest(const TrackedFrame& frame) {
  KnownState s = carried;
  const ImuStatistics read = stationary.statistics();
  const RestBiases at_rest = biases_at_rest(read, window.calibration.scale, s.x.R);
  if (std::abs(read.mean_specific_force.norm() - kGravity) > kForceTolerance) {
    reset();
    return {};
  }
  s.x.v.setZero();
  s.x.b_a = at_rest.b_a;
  s.x.b_g = at_rest.b_g;
  s.P = covariance_at_rest(at_rest, s.x.R, s.P);
  s.with_calibration.setZero();
  ++stats.resets;
  ++odometry.reset_counter;
  forget();
  carried = s;
  go_on_from_carried(frame);
  return {true, true};
}

/// Integrates the interval that ends at frame k anew, if the readings reach back to its beginning.
void Estimator::Impl::integrate_again(int k, const Vec3& b_a, const Vec3& b_g) {
  const HostStamp begin = window.at(k - 1).time;
  if (!window.at(k).imu.knows_motion || history.empty() || history.oldest_stamp() > begin) return;
  Slot anew = window.at(k);
  anew.imu.reset(b_a, b_g, window.calibration.scale);
  if (integrate(window.at(k - 1), anew) && whiten(anew)) window.at(k) = anew;
}

/// Intervals whose bias moved far from their linearisation point.
void Estimator::Impl::reintegrate_moved_biases() {
  for (int k = 1; k < window.size(); ++k) {
    const Preintegration& imu = window.at(k).imu;
    const NavState& from = window.at(k - 1).x;
    const ImuScale& scale = window.calibration.scale;
    if ((imu.b_a - from.b_a).norm() > kReintegrateAccelerometer ||
        (imu.b_g - from.b_g).norm() > kReintegrateGyroscope ||
        std::abs(imu.scale.accelerometer - scale.accelerometer) > kReintegrateScale ||
        std::abs(imu.scale.gyroscope - scale.gyroscope) > kReintegrateScale)
      integrate_again(k, from.b_a, from.b_g);
  }
}

/// Intervals that ended at a reading, or shortly after one, whose verdict was not final yet.
void Estimator::Impl::reintegrate_revised() {
  const auto revised = history.take_revised();
  if (!revised) return;
  for (int k = 1; k < window.size(); ++k) {
    const Slot& s = window.at(k);
    if (s.time > *revised) integrate_again(k, s.imu.b_a, s.imu.b_g);
  }
}

SolverSettings Estimator::Impl::solver_settings(const Supervisor::Effort& effort) const {
  const bool young =
      window_age_s(window.newest().time) < kYoungWindow_s || rejected_last || window.newest().only_images();
  SolverSettings settings = solver_settings(young ? kStepsOfYoung : config.steps);
  if (effort.most_steps > 0) {
    settings.steps = std::min(settings.steps, effort.most_steps);
    settings.attempts = effort.most_steps;
    settings.tried = effort.most_steps > 1;
  }
  return settings;
}

SolverSummary Estimator::Impl::solve(Supervisor& supervisor, const Supervisor::Effort& effort) {
  supervisor.phase(Supervisor::Phase::kSolve);
  const ChosenTracks chosen = choose_tracks(window, effort.most_tracks);
  visual->collect(window, visual_settings());
  const SolverSummary s = solver.optimise(window, *visual, solver_settings(effort), supervisor);
  supervisor.phase(Supervisor::Phase::kNone);
  rejected_last = s.rejected > 0;
  stats.tracks_offered += static_cast<std::uint64_t>(chosen.offered);
  stats.tracks_used += static_cast<std::uint64_t>(chosen.used);
  count(s);
  return s;
}

void Estimator::Impl::count(const SolverSummary& s) {
  const int calibration = (config.estimate_time_offset ? 1 : 0) + (config.estimate_extrinsics ? 6 : 0) +
                          (estimates_focal_length() ? 1 : 0) + (config.estimate_imu_scale ? kImuScales : 0);
  ++stats.solves;
  stats.linearisations += static_cast<std::uint64_t>(s.linearisations);
  stats.iterations += static_cast<std::uint64_t>(s.accepted + s.rejected);
  stats.residuals += static_cast<std::uint64_t>(s.residuals);
  stats.state_size += static_cast<std::uint64_t>(15 * window.size() + visual->unknowns() + calibration);
  stats.gated += static_cast<std::uint64_t>(s.gated);
  stats.deadline_hits += s.outcome == SolverOutcome::kOutOfTime ? 1 : 0;
  stats.gate_suspended += visual->gate_suspended() ? 1 : 0;
  stats.solver_failures += s.failed() ? 1 : 0;
}

/// What the solved window's residuals say: whether images and IMU contradict each other, and how large the bearings'
/// noise is.
void Estimator::Impl::learn_from_residuals(const SolverSummary& s, double dt_s) {
  const TrackFit fit = visual->track_fit();
  if (!(fit.median_px > 0)) return;
  constexpr int kMotion = 9;  // numbers of an interval
  contradictions.add(fit, s.imu_cost / (kMotion * (window.size() - 1)), dt_s, window.newest().at_rest);
  if (config.estimate_pixel_sigma) adapt_pixel_sigma(fit.median_px, dt_s);
}

/// The scales follow the residuals slowly. Both follow the same figure: white noise of s looks like a drift with steps
/// of s between solved images that are two images apart.
void Estimator::Impl::adapt_pixel_sigma(double seen, double dt_s) {
  const double share = std::min(1.0, dt_s / kSigmaMemory_s);
  pixel_sigma += share * (std::clamp(seen, kLeastPixelSigma, kMostPixelSigma) - pixel_sigma);
  drift_sigma += share * (std::clamp(seen, kDriftLeast, kMostPixelSigma) - drift_sigma);
}

/// `e`: what the caller knows of the frame; the rest is filled in here.
void Estimator::Impl::judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s) {
  const StateCovariance& C = carried.P;
  const NavState& x = carried.x;
  e.solved = true;
  e.finite = is_finite(carried);
  e.tracks = static_cast<int>(frame.features.size());
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (window.rig.use[i + 1]) e.tracks += static_cast<int>(frame.others[i].alone.size());
  e.gated_share = s.tracks > 0 ? static_cast<double>(s.gated) / s.tracks : 0;
  e.steps_rejected = s.failed();
  e.deadline_missed = s.outcome == SolverOutcome::kOutOfTime;
  e.imu_gap = imu_gap_seen;
  e.speed = x.v.norm();
  e.sigma_velocity = sigma_velocity(x, C);
  e.sigma_tilt = sigma_tilt(x, C);
  e.bias_accelerometer = x.b_a.norm();
  e.bias_gyroscope = x.b_g.norm();
  e.numbers_wrong = numbers_wrong;
  e.at_rest = window.newest().at_rest;
  e.parallax_px = widest_parallax_px(window, config.extrinsics.focal_px);
  if (!window.newest().only_images()) depth_known = e.parallax_px > kDepthKnown_px;
  imu_gap_seen = false;
  odometry.health = monitor.update(e, dt_s);
  carried.trusted = odometry.health.state == HealthState::kTracking || odometry.health.state == HealthState::kDegraded;
}

/// Frame k says too little to be kept: it goes, or, so that the IMU's memory lasts, stays until two later ones were
/// kept for the same reason.
void Estimator::Impl::thin(int k) {
  if (window.at(k).imu.T + window.at(k + 1).imu.T <= kLongestInterval_s) {
    drop(k);  // or, for once, stays
    return;
  }
  window.at(k).for_time = true;
  if (k >= 3 && window.at(k - 1).for_time && window.at(k - 2).for_time) drop(k - 2);
}

/// Frame k goes: its two IMU intervals become one, its bearings are lost. False, and nothing happens: the interval
/// cannot be weighed.
bool Estimator::Impl::drop(int k) {
  Slot joint = window.at(k + 1);
  joint.wheel = window.at(k).wheel;
  joint.unknown_acceleration = std::max(joint.unknown_acceleration, window.at(k).unknown_acceleration);
  joint.wheel.join(window.at(k).imu.dR, window.at(k + 1).wheel);
  joint.imu = window.at(k).imu;
  joint.imu.join(window.at(k + 1).imu);
  if (joint.imu.T > kLongestInterval_s) joint.imu.forget_motion();
  if (!whiten(joint)) return false;
  window.at(k + 1) = joint;
  marginaliser.forget_pose(window, k);
  window.remove(k);
  return true;
}

/// Where the gyroscope warms up, that is what contradicted. An accelerometer's bias moves so with a wrong number, too.
void Estimator::Impl::learn_walks() {
  const NavState& x = carried.x;
  const StateCovariance& P = carried.P;
  const ImuNoise& now = density.noise;
  accelerometer_walk.add(carried.time, x.b_a, P.block<3, 3>(9, 9), now.accelerometer_random_walk);
  if (gyroscope_walk.add(carried.time, x.b_g, P.block<3, 3>(12, 12), now.gyroscope_random_walk))
    contradictions.forget_imu();
}

void Estimator::Impl::marginalise(Supervisor& supervisor) {
  supervisor.phase(Supervisor::Phase::kMarginalise);
  if (config.estimate_time_offset)
    inflate_calibration(window.prior, 0,
                        kTimeOffsetWalk * kTimeOffsetWalk * (window.at(1).time - last_marginalised).seconds());
  last_marginalised = window.at(1).time;
  remember_beam_tracks();
  marginaliser.marginalise_oldest(window, *visual, visual_settings());
  supervisor.phase(Supervisor::Phase::kNone);
}

/// Whether the second newest frame says enough beside the keyframe before it to stay longer than recent frames do, or
/// others at rest are linked to it.
bool Estimator::Impl::second_newest_stays() const {
  const int k = window.size() - 2;
  int j = k - 1;
  while (j > 0 && !window.at(j).stays) --j;
  const KeyframeSettings rule{config.keyframe_parallax_px, config.extrinsics.focal_px};
  return window.at(k).id == rest_frame || is_keyframe(window, j, k, rule);
}

/// The frame that has become too old to be kept for its own sake stays if it is a keyframe; a full window loses its
/// oldest frame to the prior. A window without room for keyframes beside the recent frames drops none.
void Estimator::Impl::slide(Supervisor& supervisor) {
  if (window.capacity() - 2 > kRecentFrames && window.size() > 1)
    window.at(window.size() - 2).stays = second_newest_stays();
  const int k = window.size() - 2 - kRecentFrames;
  if (k >= 1) {
    if (window.at(k).stays || ends_long_rest(window, k)) {
      ++stats.keyframes;
    } else {
      thin(k);
    }
  }
  while (window.full()) marginalise(supervisor);  // after a start, several may be too many
  window.prune();
}

/// An image between two that are solved.
StepResult Estimator::Impl::predict(const TrackedFrame& frame) {
  publish(frame.stamp, carried_to(imu_time(frame.stamp)));
  return {true, false};
}

/// There is no time to solve this frame, though it is due.
StepResult Estimator::Impl::predict_for_time(const TrackedFrame& frame) {
  ++stats.frames_predicted_for_time;
  say(HealthReason::kOverloaded);
  return predict(frame);
}

/// `s` is of the image's exposure on the IMU's clock.
void Estimator::Impl::publish(HostStamp image, const KnownState& s) {
  // Pose and velocity are those of the printed stamp, read as a time of the IMU's clock: taken back (or on) by the
  // offset.
  const NavState x = moved_in_time(history, window.calibration.scale, s.x, s.time, image);
  const Eigen::Quaterniond q(x.R);
  odometry.stamp = image;
  Eigen::Map<Vec3>(odometry.p_WB_m.data()) = x.p;
  odometry.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Vec3>(odometry.v_WB_m_s.data()) = x.v;
  Eigen::Map<Vec3>(odometry.omega_B_rad_s.data()) = s.omega - x.b_g;
  Eigen::Map<Vec3>(odometry.accelerometer_bias_m_s2.data()) = x.b_a;
  Eigen::Map<Vec3>(odometry.gyroscope_bias_rad_s.data()) = x.b_g;
  odometry.imu_scale = {window.calibration.scale.accelerometer, window.calibration.scale.gyroscope};
  odometry.time_offset_s = window.calibration.time_offset;
  Eigen::Map<StateCovariance>(odometry.covariance.data()) = s.P + covariance_added(world, x);
}

VisualSettings Estimator::Impl::visual_settings() const {
  VisualSettings s;
  s.pixel_sigma = pixel_sigma;
  s.sigma_inflation = config.sigma_inflation;
  s.cauchy = config.cauchy;
  if (config.visual_factor == VisualFactor::kTrack) s.noise = config.track_noise;
  s.drift_sigma = drift_sigma;
  s.drift_inflation = config.drift_inflation;
  s.student = config.drift_student;
  s.gate = !window.newest().only_images() && window_age_s(window.newest().time) > kGateFree_s;
  s.gate_cap = config.gate_cap;
  s.focal_px = config.extrinsics.focal_px;
  s.extrinsics = config.estimate_extrinsics;
  s.rows = exposed_within_s() > 0;
  s.focal = estimates_focal_length();
  return s;
}

}  // namespace epiline
