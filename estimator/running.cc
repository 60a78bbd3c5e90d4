#include <Eigen/Geometry>
#include <algorithm>

#include "estimator/factors/imu.h"
#include "estimator/impl.h"
#include "estimator/monitor/evidence.h"
#include "estimator/predict/moved_in_time.h"
#include "estimator/window/choose_tracks.h"

namespace epiline {

namespace {
bool is_finite(const KnownState& s) {
  const NavState& x = s.x;
  return x.p.allFinite() && x.v.allFinite() && x.R.allFinite() && x.b_a.allFinite() && x.b_g.allFinite() &&
         s.P.allFinite();
}

constexpr double kYoungWindow_s = 2;  // more solver steps until the window has seen this much
constexpr int kStepsOfYoung = 3;      // solver steps of an image then, and after a rejected step: the state is far off
}  // namespace

/// One frame that is solved: its window is cut from the stream, predicted, given its measurements, solved, judged and
/// published.
StepResult Estimator::Impl::step(const TrackedFrame& frame, Supervisor& supervisor, const Supervisor::Effort& effort) {
  const double dt_s = (frame.stamp - window.newest().image_stamp).seconds();
  const KnownState last = carried;
  const bool moved = !window.newest().at_rest && !window.newest().only_images();  // as IMU and images said
  const bool sees_enough = window_age_s() > kGateFree_s && seen_again(frame) >= kSeenAgain;
  if (!cut(frame)) return start_anew(frame, supervisor);
  const KnownState predicted = carrying.predicted_newest();
  attach(frame);
  SolverSummary s = solve(supervisor, effort);
  // what contradicts a rest, or numbers that have fitted, is something that moves, a blow, or stamps
  const bool may_doubt = sees_enough && (resting.is_seen() || numbers.have_fitted());
  if (may_doubt && !doubt(moved, s, supervisor, effort)) return refuse();
  if (Slot& newest = window.newest(); newest.silent) {
    (newest.refused ? flight.after_refusal_s : flight.after_silence_s) = kGateFree_s;
    newest.omega = so3_log(window.at(window.size() - 2).x.R.transpose() * newest.x.R) / dt_s + newest.x.b_g;
  }
  // State and covariance leave together: the solver's, or the IMU's prediction.
  carried = predicted;
  carried.x = window.newest().x;
  if (s.solved()) take_from_solver(predicted.x, dt_s);
  FrameEvidence evidence;
  evidence.overloaded = effort.reduced();
  evidence.finite = is_finite(carried);
  evidence.innovation = innovation(predicted.x, predicted.P, carried.x);
  if (resting.is_contradicted(dt_s)) return begin_anew_at_rest(frame);
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
  flight.after_silence_s -= dt_s;
  flight.after_refusal_s -= dt_s;
  if (s.solved() && effort.most_steps != 1)
    learn_from_residuals(s, dt_s);  // those of an untried step are those before it
  flight.may_slide = true;
  return {true, true};
}

/// A frame with its image's stamp, after another one: by the IMU, or moving on as that did. False: there are no
/// readings for it.
bool Estimator::Impl::predict(const Slot& last, Slot& s) const {
  s.time = imu_time(s.image_stamp);
  s.time_offset_used = (s.time - s.image_stamp).seconds();
  s.x = last.x;
  s.omega = last.omega;
  s.imu.reset(last.x.b_a, last.x.b_g, window.calibration.scale);
  if (!intervals.integrate(last, s)) return false;
  if (s.silent) {
    s.x.p += s.imu.T * last.x.v;
    s.x.R = so3_normalised(last.x.R * s.imu.dR);
  } else {
    history.propagate(last.time, s.time, window.calibration.scale, s.x, s.omega);
  }
  return whiten(s);
}

/// Appends the frame. False: there are no readings for it.
bool Estimator::Impl::cut(const TrackedFrame& frame) {
  intervals.follow_readings();
  Slot cut;
  cut.image_stamp = frame.stamp;
  if (window.size() == 0) {
    cut.time = imu_time(frame.stamp);
    cut.time_offset_used = (cut.time - frame.stamp).seconds();
    history.propagate(cut.time, cut.time, window.calibration.scale, cut.x, cut.omega);
  } else if (!predict(window.newest(), cut)) {
    return false;
  }
  Slot& s = window.append();
  cut.id = s.id;
  s = cut;
  const Window::Observed seen = window.observe(frame);
  stats.tracks_refused += static_cast<std::uint64_t>(seen.without_room);
  stats.features_refused += static_cast<std::uint64_t>(seen.impossible);
  return true;
}

/// What else is known of the frame, and of those before it.
void Estimator::Impl::attach(const TrackedFrame& frame) {
  resting.attach(frame, flight.tracks.pixel_sigma, wheels.motion());
  wheels.attach();
  wheels.find_slips();
  heights.attach(flight.tracks.pixel_sigma);
  intervals.follow_biases();
}

SolverSettings Estimator::Impl::solver_settings(int steps) const {
  return {steps, config.estimate_time_offset, config.estimate_extrinsics, config.estimate_focal_length,
          config.estimate_imu_scale};
}

/// Of a window that begins knowing nothing; all but the time offset has a prior of its own (calibration_prior.h).
CalibrationTangent Estimator::Impl::calibration_sigmas() const {
  CalibrationTangent s = CalibrationTangent::Zero();
  s[0] = config.time_offset_sigma_s;
  return s;
}

SolverSettings Estimator::Impl::solver_settings(const Supervisor::Effort& effort) const {
  const bool young = window_age_s() < kYoungWindow_s || flight.rejected_last || window.newest().only_images();
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
  flight.rejected_last = s.rejected > 0;
  stats.tracks_offered += static_cast<std::uint64_t>(chosen.offered);
  stats.tracks_used += static_cast<std::uint64_t>(chosen.used);
  count(s);
  return s;
}

/// An image between two that are solved.
StepResult Estimator::Impl::predict(const TrackedFrame& frame) {
  if (imu_gap_seen) monitor.say(HealthReason::kImuGap);
  publish(frame.stamp, carrying.to(imu_time(frame.stamp)));
  return {true, false};
}

/// There is no time to solve this frame, though it is due.
StepResult Estimator::Impl::predict_for_time(const TrackedFrame& frame) {
  ++stats.frames_predicted_for_time;
  monitor.say(HealthReason::kOverloaded);
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
  s.pixel_sigma = flight.tracks.pixel_sigma;
  s.sigma_inflation = config.sigma_inflation;
  s.cauchy = config.cauchy;
  s.noise = config.track_noise;
  s.drift_sigma = flight.tracks.drift_sigma;
  s.drift_inflation = config.drift_inflation;
  s.student = config.drift_student;
  s.gate = !window.newest().only_images() && window_age_s() > kGateFree_s;
  s.gate_cap = config.gate_cap;
  s.focal_px = config.extrinsics.focal_px;
  s.extrinsics = config.estimate_extrinsics;
  s.rows = exposed_within_s() > 0;
  s.lens = config.estimate_focal_length;
  return s;
}

}  // namespace epiline
