#include "estimator/estimator.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "estimator/factors/epipolar.h"
#include "estimator/factors/reprojection.h"
#include "estimator/factors/track.h"
#include "estimator/factors/wheel.h"
#include "estimator/inertial/imu_history.h"
#include "estimator/inertial/stationary.h"
#include "estimator/initialise/starter.h"
#include "estimator/initialise/stationary_start.h"
#include "estimator/monitor/evidence.h"
#include "estimator/monitor/health.h"
#include "estimator/monitor/rest_detector.h"
#include "estimator/predict/covariance.h"
#include "estimator/solver/solver.h"
#include "estimator/window/choose_tracks.h"
#include "estimator/window/keyframe.h"
#include "estimator/window/marginalise.h"
#include "estimator/window/window.h"

namespace epiline {

namespace {
constexpr double kYoungWindow_s = 2;  // more solver steps until the window has seen this much
constexpr double kGateFree_s = 1;     // no gate until then: a young state may be further off than its tracks
constexpr double kReintegrateAccelerometer = 0.1, kReintegrateGyroscope = 0.01;  // m/s^2, rad/s
constexpr double kTimeOffsetWalk = 1e-5;                                         // s/sqrt(s)
constexpr double kSigmaMemory_s = 10, kSigmaLeast = 0.3, kSigmaMost = 2;         // px
constexpr double kHeldShare = 0.2;  // of an IMU interval: the last reading may be held so long up to a frame's time
constexpr double kLongestUnknown_s = 0.25;  // without a reading to be trusted: too far to go on from (health.md)
constexpr double kLongestStep_s = 5;        // a longer silence of the camera is a new start

// A start in motion is taken when the window's own posterior says so.
constexpr int kStartSteps = 10;
constexpr double kStartVelocity = 0.2, kStartTilt = 0.035, kStartScale = 0.15;  // m/s, rad, relative
constexpr double kStartResidual = 1.6;                                          // bearing noise seen over that assumed
constexpr double kBiasSigmaGyroscope = 0.1, kBiasSigmaAccelerometer = 0.1;      // before the first start
constexpr double kBiasSigmaGyroscopeKnown = 0.01;                               // before a start after a good run

/// For a start: without it there is nothing to hand out, so it takes its time.
class Patient final : public Supervisor {
 public:
  explicit Patient(Supervisor& watch) : watch_(watch) {}
  void phase(Phase next) noexcept override { watch_.phase(next); }

 private:
  Supervisor& watch_;
};

NewestCovariance covariance_of(const InitialState& s, double sigma_td) {
  NewestCovariance C = NewestCovariance::Zero();
  auto set = [&](int at, double sigma) { C.diagonal().segment<3>(at).setConstant(sigma * sigma); };
  set(0, s.sigma_p);
  set(6, s.sigma_v);
  set(9, s.sigma_b_a);
  set(12, s.sigma_b_g);
  const Vec3 world(s.sigma_tilt * s.sigma_tilt, s.sigma_tilt * s.sigma_tilt, s.sigma_yaw * s.sigma_yaw);
  C.block<3, 3>(3, 3) = s.R_WB.transpose() * world.asDiagonal() * s.R_WB;
  C(15, 15) = sigma_td * sigma_td;
  return C;
}

std::unique_ptr<VisualFactorModel> make_visual_factor(VisualFactor factor, const Kernels& kernels) {
  switch (factor) {
    case VisualFactor::kEpipolar:
      return std::make_unique<EpipolarFactor>();
    case VisualFactor::kReprojection:
      return std::make_unique<ReprojectionFactor>(kernels);
    case VisualFactor::kTrack:
      break;
  }
  return std::make_unique<TrackFactor>(kernels);
}
}  // namespace

struct Estimator::Impl {
  explicit Impl(const EstimatorConfig& c);

  StepResult process(const TrackedFrame& frame, Supervisor& supervisor);
  void start(const TrackedFrame& frame, const InitialState& state, StartKind kind);
  void reset();
  StepResult initialise(const TrackedFrame& frame, Supervisor& supervisor);
  std::optional<StartRefusal> try_start(const TrackedFrame& frame, Supervisor& supervisor);
  std::optional<StartRefusal> start_at_rest(const TrackedFrame& frame);
  std::optional<StartRefusal> start_moving(const TrackedFrame& frame, Supervisor& supervisor);
  std::optional<StartRefusal> posterior_refusal(const SolverSummary& s) const;
  CalibrationTangent calibration_sigmas() const;
  StarterSettings starter_settings() const;

  bool append_frame(const TrackedFrame& frame);
  void attach_rest(const TrackedFrame& frame);
  void attach_wheel();
  void reintegrate_moved_biases();
  SolverSummary solve(Supervisor& supervisor, const Supervisor::Effort& effort);
  void adapt_pixel_sigma(double dt_s);
  void slide(Supervisor& supervisor);
  void join_second_newest();
  void publish(const TrackedFrame& frame, const NavState& x, const Vec3& omega, HostStamp time);
  StepResult predict(const TrackedFrame& frame);
  StepResult predict_for_time(const TrackedFrame& frame);
  NewestCovariance covariance_carried_on() const;
  void judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s);
  StepResult refuse_without_readings();
  bool motion_unknown(const TrackedFrame& frame) const;

  VisualSettings visual_settings() const;
  double window_age_s(HostStamp now) const { return (now - started_at).seconds(); }

  EstimatorConfig config;
  ImuHistory::Density density;
  const Kernels& kernel;
  Window window;
  ImuHistory history;
  WheelHistory wheel;
  std::unique_ptr<VisualFactorModel> visual;
  Solver solver;
  Marginaliser marginaliser;
  RestDetector rest;
  StationaryDetector stationary;
  Starter starter;
  HealthMonitor monitor;
  Odometry odometry;
  NewestCovariance covariance = NewestCovariance::Zero();  ///< of the newest frame in the window
  EstimatorStats stats;

  bool any_frame = false;
  HostStamp last_frame;  ///< solved, predicted or given up
  bool started = false;
  HostStamp started_at;
  double pixel_sigma;
  bool rejected_last = false;
  bool resting = false;          ///< the zero-motion test has held without interruption
  std::uint64_t rest_frame = 0;  ///< the frame that later ones at rest are linked to
  std::uint64_t forced_keyframe = 0;
  HostStamp last_marginalised;
  bool imu_gap_seen = false;
  Vec3 b_g_known = Vec3::Zero();  ///< the last good gyroscope bias, for a new start
  double b_g_sigma = kBiasSigmaGyroscope;
  Vec3 p_WB_last = Vec3::Zero();  ///< a new start goes on where the last pose was
  double yaw_last = 0;
};

Estimator::Impl::Impl(const EstimatorConfig& c)
    : config(c),
      kernel(kernels()),
      window(std::clamp(c.keyframes, 2, kMaxFrames - 1) + 1),
      visual(make_visual_factor(c.visual_factor, kernel)),
      solver(kernel),
      marginaliser(kernel),
      stationary(c.imu),
      pixel_sigma(c.pixel_sigma) {
  density.noise = c.imu;
  density.noise.gyroscope_density *= c.gyroscope_density_factor;
  density.noise.accelerometer_density *= c.accelerometer_density_factor;
  window.calibration = {c.extrinsics.time_offset_s, c.extrinsics.R_BC, c.extrinsics.p_BC};
  window.wheel = c.wheel;
  window.first_estimates = c.visual_factor == VisualFactor::kTrack;
  odometry.health.reasons = static_cast<std::uint32_t>(HealthReason::kNoInitialState);
}

VisualSettings Estimator::Impl::visual_settings() const {
  VisualSettings s;
  s.pixel_sigma = pixel_sigma;
  s.sigma_inflation = config.sigma_inflation;
  s.cauchy = config.cauchy;
  s.gate = config.gate && window_age_s(window.newest().time) > kGateFree_s;
  s.gate_cap = config.gate_cap;
  s.focal_px = config.extrinsics.focal_px;
  s.extrinsics = config.estimate_extrinsics;
  return s;
}

/// Appends the frame, predicted by the IMU. False: no readings for it.
bool Estimator::Impl::append_frame(const TrackedFrame& frame) {
  const Calibration& calibration = window.calibration;
  const HostStamp time = frame.stamp + Span::from_seconds(calibration.time_offset);
  Preintegration interval;
  NavState x;
  Vec3 omega = Vec3::Zero();
  history.propagate(time, time, x, omega);
  if (window.size() > 0) {
    const Slot& last = window.newest();
    x = last.x;
    interval.reset(x.b_a, x.b_g);
    if (!history.integrate(last.time, time, density, interval)) return false;
    history.propagate(last.time, time, x, omega);
  }
  Slot& s = window.append();
  s.image_stamp = frame.stamp;
  s.time = time;
  s.time_offset_used = (time - frame.stamp).seconds();
  s.x = x;
  s.omega = omega;
  s.imu = interval;
  stats.tracks_refused += static_cast<std::uint64_t>(window.observe(frame));
  return window.size() == 1 || whiten(s);
}

/// Zero motion (docs/derivations/zero_motion.md): at its first success the candidate becomes a keyframe, once, and
/// later frames at rest are tied to it.
void Estimator::Impl::attach_rest(const TrackedFrame& frame) {
  const int n = window.size();
  Slot& newest = window.newest();
  const double rate = n > 1 ? history.mean_rate(window.at(n - 2).time, newest.time, newest.x.b_g) : 0;
  const bool still = rest.update(frame, pixel_sigma, rate);
  if (!config.zero_motion || !still || n < 2 || is_blind(frame.reasons)) {
    resting = false;
    return;
  }
  if (!resting || window.index_of(rest_frame) < 0) rest_frame = forced_keyframe = window.at(n - 2).id;
  resting = true;
  newest.at_rest = true;
  newest.rest_link = rest_frame;
  ++stats.zero_motion_frames;
}

/// Frames whose time lies between two speeds get one, once; the second of the two may come after the frame.
void Estimator::Impl::attach_wheel() {
  for (int k = 0; k < window.size(); ++k) {
    Slot& s = window.at(k);
    if (s.has_wheel || !wheel.speed_at(s.time, s.wheel_speed_m_s)) continue;
    s.has_wheel = true;
    ++stats.wheel_frames;
  }
}

/// Intervals whose bias moved far from their linearisation point are integrated again, as far back as the readings
/// reach.
void Estimator::Impl::reintegrate_moved_biases() {
  for (int k = 1; k < window.size(); ++k) {
    Slot& s = window.at(k);
    const NavState& from = window.at(k - 1).x;
    const bool moved = (s.imu.b_a - from.b_a).norm() > kReintegrateAccelerometer ||
                       (s.imu.b_g - from.b_g).norm() > kReintegrateGyroscope;
    if (!moved || history.empty() || history.oldest_stamp() > window.at(k - 1).time) continue;
    s.imu.reset(from.b_a, from.b_g);
    history.integrate(window.at(k - 1).time, s.time, density, s.imu);
    whiten(s);
  }
}

SolverSummary Estimator::Impl::solve(Supervisor& supervisor, const Supervisor::Effort& effort) {
  attach_wheel();
  reintegrate_moved_biases();
  const bool young = window_age_s(window.newest().time) < kYoungWindow_s || rejected_last;
  SolverSettings settings{young ? config.steps_young : config.steps, config.estimate_time_offset,
                          config.estimate_extrinsics};
  if (effort.most_steps > 0) {
    settings.steps = std::min(settings.steps, effort.most_steps);
    settings.attempts = effort.most_steps;
    settings.tried = effort.most_steps > 1;
  }
  supervisor.phase(Supervisor::Phase::kSolve);
  const ChosenTracks chosen = choose_tracks(window, effort.most_tracks);
  visual->collect(window, visual_settings());
  const SolverSummary s = solver.optimise(window, *visual, settings, supervisor);
  supervisor.phase(Supervisor::Phase::kNone);
  rejected_last = s.rejected > 0;
  ++stats.solves;
  stats.linearisations += static_cast<std::uint64_t>(s.linearisations);
  stats.tracks_offered += static_cast<std::uint64_t>(chosen.offered);
  stats.tracks_used += static_cast<std::uint64_t>(chosen.used);
  stats.iterations += static_cast<std::uint64_t>(s.accepted + s.rejected);
  stats.residuals += static_cast<std::uint64_t>(s.residuals);
  stats.state_size +=
      static_cast<std::uint64_t>(15 * window.size() + visual->unknowns() + (config.estimate_time_offset ? 1 : 0) +
                                 (config.estimate_extrinsics ? 6 : 0));
  stats.gated += static_cast<std::uint64_t>(s.gated);
  stats.deadline_hits += s.out_of_time ? 1 : 0;
  stats.gate_suspended += visual->gate_suspended() ? 1 : 0;
  return s;
}

/// The kernel's scale follows what the residuals show, slowly.
void Estimator::Impl::adapt_pixel_sigma(double dt_s) {
  if (!config.estimate_pixel_sigma) return;
  const double seen = visual->residual_sigma_px();
  if (seen > 0)
    pixel_sigma += std::min(1.0, dt_s / kSigmaMemory_s) * (std::clamp(seen, kSigmaLeast, kSigmaMost) - pixel_sigma);
}

/// The second newest frame goes: its two IMU intervals become one, its bearings are lost. Unless the factor wants it
/// so, it is never in the prior.
void Estimator::Impl::join_second_newest() {
  const int n = window.size();
  Preintegration joined = window.at(n - 2).imu;
  joined.join(window.at(n - 1).imu);
  window.newest().imu = joined;
  whiten(window.newest());
  marginaliser.forget_pose(window, n - 2);
  window.remove(n - 2);
}

void Estimator::Impl::slide(Supervisor& supervisor) {
  const int n = window.size();
  if (n >= 3) {
    const KeyframeSettings rule{config.keyframe_rule, config.keyframe_parallax_px, config.extrinsics.focal_px};
    if (window.at(n - 2).id != forced_keyframe && !is_keyframe(window, rule)) {
      join_second_newest();
    } else {
      ++stats.keyframes;
      if (window.full()) {
        supervisor.phase(Supervisor::Phase::kMarginalise);
        if (config.estimate_time_offset)
          inflate_calibration(window.prior, 0,
                              kTimeOffsetWalk * kTimeOffsetWalk * (window.at(1).time - last_marginalised).seconds());
        last_marginalised = window.at(1).time;
        marginaliser.marginalise_oldest(window, *visual, visual_settings());
        supervisor.phase(Supervisor::Phase::kNone);
      }
    }
  }
  window.prune();
}

void Estimator::Impl::publish(const TrackedFrame& frame, const NavState& x, const Vec3& omega_raw, HostStamp time) {
  // The pose is that of the printed stamp, read as a time of the IMU's clock: taken back (or on) by the offset.
  const double dt = (frame.stamp - time).seconds();
  const Vec3 omega = omega_raw - x.b_g;
  const Vec3 p = x.p + x.v * dt;
  const Eigen::Quaterniond q(x.R * so3_exp(omega * dt));
  odometry.stamp = frame.stamp;
  Eigen::Map<Vec3>(odometry.p_WB_m.data()) = p;
  odometry.q_WB = {q.w(), q.x(), q.y(), q.z()};
  Eigen::Map<Vec3>(odometry.v_WB_m_s.data()) = x.v;
  Eigen::Map<Vec3>(odometry.omega_B_rad_s.data()) = omega;
  Eigen::Map<Vec3>(odometry.accelerometer_bias_m_s2.data()) = x.b_a;
  Eigen::Map<Vec3>(odometry.gyroscope_bias_rad_s.data()) = x.b_g;
  odometry.time_offset_s = window.calibration.time_offset;
}

StepResult Estimator::Impl::predict(const TrackedFrame& frame) {
  const Slot& s = window.newest();
  const HostStamp time = frame.stamp + Span::from_seconds(window.calibration.time_offset);
  NavState x = s.x;
  Vec3 omega = s.omega;
  history.propagate(s.time, time, x, omega);
  publish(frame, x, omega, time);
  Preintegration interval;
  interval.reset(s.x.b_a, s.x.b_g);
  if (history.integrate(s.time, time, density, interval))
    Eigen::Map<NewestCovariance>(odometry.covariance.data()) =
        carried_on(into_body(covariance, s.x.R), s.x.R, interval);
  return {true, false, false};
}

/// There is no time to solve this frame, though it is due.
StepResult Estimator::Impl::predict_for_time(const TrackedFrame& frame) {
  ++stats.frames_predicted_for_time;
  odometry.health.reasons |= static_cast<std::uint32_t>(HealthReason::kOverloaded);
  if (odometry.health.state == HealthState::kTracking) odometry.health.state = HealthState::kDegraded;
  return predict(frame);
}

/// Of the newest frame before its solve: the IMU's prediction.
NewestCovariance Estimator::Impl::covariance_carried_on() const {
  const Mat3& R = window.at(window.size() - 2).x.R;
  return carried_on(into_body(covariance, R), R, window.newest().imu);
}

/// `e`: what the caller knows of the frame; the rest is filled in here.
void Estimator::Impl::judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s) {
  const NewestCovariance& C = covariance;
  const NavState& x = window.newest().x;
  e.solved = true;
  e.finite =
      x.p.allFinite() && x.v.allFinite() && x.R.allFinite() && x.b_a.allFinite() && x.b_g.allFinite() && C.allFinite();
  e.tracks = static_cast<int>(frame.features.size());
  e.gated_share = s.tracks > 0 ? static_cast<double>(s.gated) / s.tracks : 0;
  e.steps_rejected = !s.ok;
  e.deadline_missed = s.out_of_time;
  e.imu_gap = imu_gap_seen;
  e.sigma_velocity = std::sqrt(C.diagonal().segment<3>(6).maxCoeff());
  // tilt: the rotation error's components across gravity
  const Mat3 world = x.R * C.block<3, 3>(3, 3) * x.R.transpose();
  e.sigma_tilt = std::sqrt(std::max(world(0, 0), world(1, 1)));
  e.bias_accelerometer = x.b_a.norm();
  e.bias_gyroscope = x.b_g.norm();
  e.at_rest = window.newest().at_rest;
  e.parallax_px = widest_parallax_px(window, config.extrinsics.focal_px);
  imu_gap_seen = false;
  odometry.health = monitor.update(e, dt_s);
  Eigen::Map<NewestCovariance>(odometry.covariance.data()) = C;
}

CalibrationTangent Estimator::Impl::calibration_sigmas() const {
  CalibrationTangent s;
  s << config.time_offset_sigma_s, Vec3::Constant(config.extrinsic_rotation_sigma_rad),
      Vec3::Constant(config.extrinsic_translation_sigma_m);
  return s;
}

StarterSettings Estimator::Impl::starter_settings() const {
  StarterSettings s;
  s.pixel_sigma = pixel_sigma;
  s.focal_px = config.extrinsics.focal_px;
  s.b_g_sigma = b_g_sigma;
  s.b_a_sigma = kBiasSigmaAccelerometer;
  s.b_g_reference = b_g_known;
  s.p_WB = p_WB_last;
  s.yaw = yaw_last;
  s.calibration_sigmas = calibration_sigmas();
  return s;
}

/// At rest the mean readings give attitude and gyroscope bias at once; the images must agree that nothing moves.
std::optional<StartRefusal> Estimator::Impl::start_at_rest(const TrackedFrame& frame) {
  const ImuStatistics readings = stationary.statistics();
  if (!rest.images_still() || !stationary.is_stationary(readings)) return StartRefusal::kNoParallax;
  InitialState state;
  const RestReadings mean{readings.mean_specific_force, readings.mean_rate, readings.duration_s};
  if (const auto refusal = solve_stationary_start(mean, config.imu, kBiasSigmaAccelerometer, state)) return refusal;
  state.R_WB = so3_exp(Vec3(0, 0, yaw_last)) * state.R_WB;
  state.p_WB = p_WB_last;
  start(frame, state, StartKind::kStationary);
  return std::nullopt;
}

/// Whether the window's posterior is good enough to hand out poses (docs/derivations/health.md).
std::optional<StartRefusal> Estimator::Impl::posterior_refusal(const SolverSummary& s) const {
  const NewestCovariance& C = solver.covariance();
  const NavState& x = window.newest().x;
  if (!s.ok || !C.allFinite() || !x.p.allFinite()) return StartRefusal::kSolverFailed;
  const double sigma_v = std::sqrt(C.diagonal().segment<3>(6).maxCoeff());
  const Mat3 attitude = x.R * C.block<3, 3>(3, 3) * x.R.transpose();
  if (std::sqrt(std::max(attitude(0, 0), attitude(1, 1))) > kStartTilt) return StartRefusal::kTiltUncertain;
  if (sigma_v > kStartVelocity) return StartRefusal::kVelocityUncertain;
  const Vec3 path = x.p - window.at(0).x.p;
  const double length = path.norm();
  if (length > 0) {
    const Vec3 along = path / length;
    if (std::sqrt(along.dot(C.block<3, 3>(0, 0) * along)) > kStartScale * length) return StartRefusal::kScaleUncertain;
  }
  return std::nullopt;
}

std::optional<StartRefusal> Estimator::Impl::start_moving(const TrackedFrame& frame, Supervisor& supervisor) {
  if (const auto refusal = starter.start_moving(window, starter_settings())) return refusal;
  started_at = window.at(0).time;
  attach_wheel();
  reintegrate_moved_biases();
  const SolverSettings settings{kStartSteps, config.estimate_time_offset, config.estimate_extrinsics};
  supervisor.phase(Supervisor::Phase::kSolve);
  visual->restart();
  choose_tracks(window, 0);
  visual->collect(window, visual_settings());
  Patient patient(supervisor);
  const SolverSummary s = solver.optimise(window, *visual, settings, patient);
  supervisor.phase(Supervisor::Phase::kNone);
  auto refusal = posterior_refusal(s);
  const double seen = visual->residual_sigma_px();
  if (!refusal && seen > kStartResidual * pixel_sigma) refusal = StartRefusal::kResidualTooLarge;
  if (refusal) {
    window.prior.frames = 0;
    for (int k = 0; k < window.size(); ++k) window.at(k).x = NavState{.b_g = b_g_known};
    reintegrate_moved_biases();
    window.calibration = {config.extrinsics.time_offset_s, config.extrinsics.R_BC, config.extrinsics.p_BC};
    return refusal;
  }
  monitor.restart();
  started = true;
  resting = false;
  last_marginalised = started_at;
  stats.start_kind = StartKind::kMoving;
  covariance = solver.covariance();
  judge(frame, s, {}, config.solve_interval_s);
  publish(frame, window.newest().x, window.newest().omega, window.newest().time);
  return std::nullopt;
}

std::optional<StartRefusal> Estimator::Impl::try_start(const TrackedFrame& frame, Supervisor& supervisor) {
  ++stats.start_attempts;
  rest.update(frame, pixel_sigma, 0);
  if (!start_at_rest(frame)) return std::nullopt;
  return start_moving(frame, supervisor);
}

StepResult Estimator::Impl::initialise(const TrackedFrame& frame, Supervisor& supervisor) {
  if (window.full()) window.remove(0);
  if (!append_frame(frame)) {
    window.clear();
    ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
    return {};
  }
  if (window.size() == 1) window.newest().x.b_g = b_g_known;
  if (const auto refusal = try_start(frame, supervisor)) {
    ++stats.start_refused[static_cast<int>(*refusal)];
    window.prune();
    return {};
  }
  slide(supervisor);
  return {true, true, false};
}

bool Estimator::Impl::motion_unknown(const TrackedFrame& frame) const {
  const HostStamp time = frame.stamp + Span::from_seconds(window.calibration.time_offset);
  return history.longest_unknown_s(window.newest().time, time) > kLongestUnknown_s;
}

/// A guess held in place of readings is so far off that one step from it, at Jacobians kept from it, misleads the
/// window for seconds. Without the frame the next one bridges the hole between true readings.
StepResult Estimator::Impl::refuse_without_readings() {
  ++stats.frames_refused;
  odometry.health.reasons |= bit(HealthReason::kImuSilent);
  if (odometry.health.state == HealthState::kTracking) odometry.health.state = HealthState::kDegraded;
  return {};
}

StepResult Estimator::Impl::process(const TrackedFrame& frame, Supervisor& supervisor) {
  ++stats.frames;
  if (any_frame && frame.stamp <= last_frame) {
    ++stats.frames_refused;
    return {};
  }
  any_frame = true;
  last_frame = frame.stamp;
  if (started && !history.reaches(frame.stamp + Span::from_seconds(window.calibration.time_offset)))
    return refuse_without_readings();
  if (window.size() > 0 && motion_unknown(frame)) {
    reset();
    return {};
  }
  if (window.size() > 0) {
    const double since = (frame.stamp - window.newest().image_stamp).seconds();
    if (since > kLongestStep_s)
      reset();
    else if (since < 0.75 * config.solve_interval_s)
      return started ? predict(frame) : StepResult{};
  }
  if (!started) return initialise(frame, supervisor);
  const Supervisor::Effort effort = supervisor.effort();
  if (!effort.solve) return predict_for_time(frame);
  const double dt = (frame.stamp - window.newest().image_stamp).seconds();
  if (!append_frame(frame)) {
    ++stats.frames_refused;
    reset();
    return {};
  }
  attach_rest(frame);
  const NavState predicted = window.newest().x;
  const NewestCovariance P = covariance_carried_on();
  const SolverSummary s = solve(supervisor, effort);
  if (effort.most_steps != 1) adapt_pixel_sigma(dt);    // the residuals of an untried step are those before it
  covariance = s.unimproved ? P : solver.covariance();  // unimproved: the state is the prediction, too
  FrameEvidence evidence;
  evidence.overloaded = effort.reduced();
  evidence.innovation = innovation(predicted, P, window.newest().x);
  judge(frame, s, evidence, dt);
  if (monitor.reset_wanted()) {
    reset();
    return {};
  }
  publish(frame, window.newest().x, window.newest().omega, window.newest().time);
  const std::uint64_t keyframes = stats.keyframes;
  slide(supervisor);
  return {true, true, stats.keyframes > keyframes};
}

void Estimator::Impl::start(const TrackedFrame& frame, const InitialState& state, StartKind kind) {
  window.clear();
  rest.clear();
  monitor.restart();
  append_frame(frame);
  Slot& s = window.newest();
  s.x.p = state.p_WB;
  s.x.v = state.v_WB;
  s.x.R = state.R_WB;
  s.x.b_a = state.b_a;
  s.x.b_g = state.b_g;
  set_initial_prior(window, state, calibration_sigmas());
  started = true;
  started_at = last_marginalised = s.time;
  resting = false;
  rejected_last = false;
  stats.start_kind = kind;
  publish(frame, s.x, s.omega, s.time);
  covariance = covariance_of(state, config.time_offset_sigma_s);
  Eigen::Map<NewestCovariance>(odometry.covariance.data()) = covariance;
  odometry.health = {};
  odometry.health.reasons = static_cast<std::uint32_t>(HealthReason::kPosteriorWide);
}

void Estimator::Impl::reset() {
  if (started) {
    const HealthState last = odometry.health.state;
    const bool good = last == HealthState::kTracking || last == HealthState::kDegraded;
    b_g_known = good ? window.newest().x.b_g : Vec3(Vec3::Zero());
    b_g_sigma = good ? kBiasSigmaGyroscopeKnown : kBiasSigmaGyroscope;
    ++stats.resets;
    ++odometry.reset_counter;
    const Vec3 p(odometry.p_WB_m.data());
    const Mat3 R =
        Eigen::Quaterniond(odometry.q_WB[0], odometry.q_WB[1], odometry.q_WB[2], odometry.q_WB[3]).toRotationMatrix();
    if (p.allFinite() && R.allFinite()) {
      p_WB_last = p;
      yaw_last = std::atan2(R(1, 0), R(0, 0));
    }
  }
  window.clear();
  window.calibration = {config.extrinsics.time_offset_s, config.extrinsics.R_BC, config.extrinsics.p_BC};
  rest.clear();
  monitor.restart();
  started = resting = false;
  odometry.health = {HealthState::kInitialising, static_cast<std::uint32_t>(HealthReason::kNoInitialState), 0};
}

Estimator::Estimator(const EstimatorConfig& config) : impl_(new Impl(config)) {}
Estimator::~Estimator() = default;

bool Estimator::add_imu(const ImuSample& sample) noexcept {
  Impl& m = *impl_;
  ++m.stats.imu_samples;
  switch (m.history.push(sample)) {
    case ImuHistory::Push::kOutOfOrder:
      ++m.stats.imu_out_of_order;
      return false;
    case ImuHistory::Push::kDuplicate:
      ++m.stats.imu_duplicate;
      return false;
    case ImuHistory::Push::kNotFinite:
      ++m.stats.imu_not_finite;
      return false;
    case ImuHistory::Push::kTaken:
      break;
  }
  if ((sample.reasons & kDistrustReasons) == 0) m.stationary.add(sample);
  const ImuHistory::Reading& r = m.history.newest();
  if (r.w.cwiseAbs().maxCoeff() >= m.config.saturation_gyroscope_rad_s ||
      r.a.cwiseAbs().maxCoeff() >= m.config.saturation_accelerometer_m_s2 ||
      (sample.reasons & bit(HealthReason::kImuSaturated)) != 0)
    ++m.stats.imu_saturated;
  if (m.history.after_gap()) {
    ++m.stats.imu_gaps;
    m.imu_gap_seen = true;
  }
  return true;
}

bool Estimator::add_wheel(const WheelSample& sample) noexcept {
  const bool taken = impl_->config.wheel.use && impl_->wheel.push(sample);
  ++(taken ? impl_->stats.wheel_samples : impl_->stats.wheel_refused);
  return taken;
}

HostStamp Estimator::imu_needed_until(HostStamp image) const noexcept {
  return image + Span::from_seconds(impl_->window.calibration.time_offset - kHeldShare * impl_->history.period());
}

StepResult Estimator::process(const TrackedFrame& frame, Supervisor& supervisor) noexcept {
  EstimatorStats& stats = impl_->stats;
  const std::uint64_t refused = stats.frames_refused;
  const StepResult result = impl_->process(frame, supervisor);
  if (result.solved) {
    ++stats.frames_solved;
  } else if (result.has_pose) {
    ++stats.frames_predicted;
  } else if (stats.frames_refused == refused) {
    ++stats.frames_without_pose;
  }
  return result;
}

void Estimator::start(const TrackedFrame& frame, const InitialState& state) noexcept {
  impl_->start(frame, state, StartKind::kGiven);
}

const Odometry& Estimator::odometry() const noexcept { return impl_->odometry; }
const EstimatorStats& Estimator::stats() const noexcept {
  impl_->stats.pixel_sigma = impl_->pixel_sigma;
  return impl_->stats;
}
Vec3 Estimator::gyroscope_bias() const noexcept {
  return impl_->window.size() > 0 ? impl_->window.newest().x.b_g : impl_->b_g_known;
}

const char* to_string(StartRefusal r) {
  switch (r) {
    case StartRefusal::kTooFewFrames:
      return "too_few_frames";
    case StartRefusal::kTooFewTracks:
      return "too_few_tracks";
    case StartRefusal::kNoImu:
      return "no_imu";
    case StartRefusal::kNoParallax:
      return "no_parallax";
    case StartRefusal::kSolverFailed:
      return "solver_failed";
    case StartRefusal::kResidualTooLarge:
      return "residual_too_large";
    case StartRefusal::kTiltUncertain:
      return "tilt_uncertain";
    case StartRefusal::kVelocityUncertain:
      return "velocity_uncertain";
    case StartRefusal::kScaleUncertain:
      return "scale_uncertain";
    case StartRefusal::kBiasImplausible:
      return "bias_implausible";
    case StartRefusal::kCount:
      break;
  }
  return "unknown";
}

}  // namespace epiline
