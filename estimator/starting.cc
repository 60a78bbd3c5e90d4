#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/initialise/moving_start.h"
#include "estimator/initialise/stationary_start.h"
#include "estimator/monitor/evidence.h"
#include "estimator/window/choose_tracks.h"

namespace epiline {

namespace {
// A start in motion is taken when the window's own posterior says so.
constexpr int kStartSteps = 10;
constexpr int kStartWindow = 11;  // images; from ten on they show that tracks are worse than configured
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

StateCovariance covariance_of(const InitialState& s, double sigma_td) {
  StateCovariance C = StateCovariance::Zero();
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

}  // namespace

StepResult Estimator::Impl::initialise(const TrackedFrame& frame, Supervisor& supervisor) {
  // a frame that is tied to the others by fewer tracks than a start needs would hang on the IMU and on false matches
  if (seen_again(frame) < StartLimits{}.tracks) window.clear();
  if (window.size() >= std::max(kStartWindow, window.capacity())) window.remove(0);
  if (!cut(frame)) {
    window.clear();
    ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
    return {};
  }
  if (window.size() == 1) window.newest().x.b_g = known_gyroscope_bias();
  if (const auto refusal = try_start(frame, supervisor)) {
    ++stats.start_refused[static_cast<int>(*refusal)];
    window.prune();
    return {};
  }
  slide(supervisor);
  return {true, true, false};
}

std::optional<StartRefusal> Estimator::Impl::try_start(const TrackedFrame& frame, Supervisor& supervisor) {
  if (numbers_wrong == Severity::kGross) return StartRefusal::kNumbersWrong;
  ++stats.start_attempts;
  rest.update(frame, pixel_sigma, 0);
  if (!start_at_rest(frame)) return std::nullopt;
  return start_moving(frame, supervisor);
}

/// At rest the mean readings give attitude and gyroscope bias at once; the images must agree that nothing moves.
std::optional<StartRefusal> Estimator::Impl::start_at_rest(const TrackedFrame& frame) {
  const ImuStatistics readings = stationary.statistics();
  if (!rest.images_still() || !stationary.is_stationary(readings)) return StartRefusal::kNoParallax;
  if (const double force = readings.mean_specific_force.norm(); !can_be_gravity(force)) {
    numbers_wrong = Severity::kGross;
    stats.suspicions[static_cast<std::size_t>(Suspect::kAccelerometerUnits)] = {Severity::kGross, force, {}};
    return StartRefusal::kNumbersWrong;
  }
  InitialState state;
  const RestReadings mean{readings.mean_specific_force, readings.mean_rate, readings.duration_s};
  if (const auto refusal = solve_stationary_start(mean, noise, kBiasSigmaAccelerometer, state)) return refusal;
  const StarterSettings at = starter_settings();
  if (at.R_WB) state.R_WB = so3_exp(Vec3(0, 0, heading_from(state.R_WB, *at.R_WB))) * state.R_WB;
  state.p_WB = at.p_WB;
  world = {at.p_WB, at.sigma_p, at.sigma_yaw};
  start(frame, state, StartKind::kStationary);
  return std::nullopt;
}

/// Whether the window's posterior is good enough to hand out poses (docs/derivations/health.md).
std::optional<StartRefusal> Estimator::Impl::posterior_refusal(const SolverSummary& s) const {
  const StateCovariance& C = solver.covariance();
  const NavState& x = window.newest().x;
  if (!s.solved() || !C.allFinite() || !x.p.allFinite()) return StartRefusal::kSolverFailed;
  if (sigma_tilt(x, C) > kStartTilt) return StartRefusal::kTiltUncertain;
  if (sigma_velocity(x, C) > kStartVelocity) return StartRefusal::kVelocityUncertain;
  const Vec3 path = x.p - window.at(0).x.p;
  const double length = path.norm();
  if (length > 0) {
    const Vec3 along = path / length;
    if (std::sqrt(along.dot(C.block<3, 3>(0, 0) * along)) > kStartScale * length) return StartRefusal::kScaleUncertain;
  }
  return std::nullopt;
}

std::optional<StartRefusal> Estimator::Impl::start_moving(const TrackedFrame& frame, Supervisor& supervisor) {
  const StarterSettings at = starter_settings();
  const Calibration before = window.calibration;
  if (const auto refusal = starter.start_moving(window, at)) return refusal;
  const double given_sigma = pixel_sigma;
  pixel_sigma = std::max(given_sigma, starter.guess().noise_rad * config.extrinsics.focal_px);
  started_at = window.at(0).time;
  attach_wheel();
  reintegrate_moved_biases();
  supervisor.phase(Supervisor::Phase::kSolve);
  visual->restart();
  choose_tracks(window, 0);
  VisualSettings white = visual_settings();
  white.noise = TrackNoiseModel::kWhite;
  visual->collect(window, white);
  Patient patient(supervisor);
  const SolverSummary s = solver.optimise(window, *visual, solver_settings(kStartSteps), patient);
  supervisor.phase(Supervisor::Phase::kNone);
  auto refusal = posterior_refusal(s);
  const double seen = visual->track_fit().median_px;
  if (!refusal && seen > kStartResidual * pixel_sigma) refusal = StartRefusal::kResidualTooLarge;
  if (refusal) {
    pixel_sigma = given_sigma;
    take_back_start(before);
    // the window contradicts the state found, so the next attempt does not begin there
    if (refusal == StartRefusal::kResidualTooLarge || refusal == StartRefusal::kSolverFailed) starter.forget();
    return refusal;
  }
  began(StartKind::kMoving);
  remember_origin();
  const Slot& newest = window.newest();
  world = {window.prior.x0[0].p, at.sigma_p, at.sigma_yaw};
  carried = {true, true, newest.time, newest.x, newest.omega, solver.covariance()};
  judge(frame, s, {}, config.solve_interval_s);
  publish(frame.stamp, carried);
  return std::nullopt;
}

/// The window as it was before the start, without states.
void Estimator::Impl::take_back_start(const Calibration& before) {
  window.prior.frames = 0;
  const Vec3 b_g = known_gyroscope_bias();
  for (int k = 0; k < window.size(); ++k) window.at(k).x = NavState{.b_g = b_g};
  reintegrate_moved_biases();
  window.calibration = before;
}

/// The window has states from its oldest frame on.
void Estimator::Impl::began(StartKind kind) {
  monitor.restart();
  started = true;
  began_R_BC = window.calibration.R_BC;
  resting = rejected_last = false;
  started_at = last_marginalised = window.at(0).time;
  stats.start_kind = kind;
}

/// Frame 0 of a window just started.
void Estimator::Impl::remember_origin() {
  const NavState& x = window.prior.x0[0];
  const Eigen::Quaterniond q(x.R);
  stats.origins[odometry.reset_counter % stats.origins.size()] = {
      true, odometry.reset_counter, window.at(0).time, {x.p.x(), x.p.y(), x.p.z()}, {q.w(), q.x(), q.y(), q.z()}};
}

/// From a state that is known, without any search.
void Estimator::Impl::start(const TrackedFrame& frame, const InitialState& state, StartKind kind) {
  window.clear();
  visual->restart();
  rest.clear();
  cut(frame);
  Slot& s = window.newest();
  s.x.p = state.p_WB;
  s.x.v = state.v_WB;
  s.x.R = state.R_WB;
  s.x.b_a = state.b_a;
  s.x.b_g = state.b_g;
  set_initial_prior(window, state, calibration_sigmas());
  began(kind);
  remember_origin();
  carried = {true, true, s.time, s.x, s.omega, covariance_of(state, config.time_offset_sigma_s)};
  publish(frame.stamp, carried);
  odometry.health = {};
  odometry.health.reasons = bit(HealthReason::kPosteriorWide);
}

bool Estimator::Impl::estimates_focal_length() const {
  return config.estimate_focal_length && config.visual_factor == VisualFactor::kTrack;
}

SolverSettings Estimator::Impl::solver_settings(int steps) const {
  return {steps, config.estimate_time_offset, config.estimate_extrinsics, estimates_focal_length(),
          config.estimate_imu_scale};
}

Calibration Estimator::Impl::configured_calibration() const {
  return {config.extrinsics.time_offset_s, config.extrinsics.R_BC, config.extrinsics.p_BC, 0, {}};
}

/// Of a window that begins knowing nothing; all but the time offset has a prior of its own (calibration_prior.h).
CalibrationTangent Estimator::Impl::calibration_sigmas() const {
  CalibrationTangent s = CalibrationTangent::Zero();
  s[0] = config.time_offset_sigma_s;
  return s;
}

Vec3 Estimator::Impl::known_gyroscope_bias() const {
  return carried.known && carried.trusted ? carried.x.b_g : Vec3(Vec3::Zero());
}

/// For a start at the window's newest frame.
StarterSettings Estimator::Impl::starter_settings() const {
  StarterSettings s;
  s.pixel_sigma = pixel_sigma;
  s.most_pixel_sigma = config.estimate_pixel_sigma ? kMostPixelSigma : pixel_sigma;
  s.focal_px = config.extrinsics.focal_px;
  s.b_g_sigma = kBiasSigmaGyroscope;
  s.b_a_sigma = kBiasSigmaAccelerometer;
  s.calibration_sigmas = calibration_sigmas();
  if (!carried.known) return s;
  if (carried.trusted) s.b_g_sigma = kBiasSigmaGyroscopeKnown;
  s.b_g_reference = known_gyroscope_bias();
  const KnownState now = carried_to(window.newest().time);
  s.p_WB = now.x.p;
  s.R_WB = now.x.R;
  const StateCovariance P = now.P + covariance_added(world, now.x);
  s.sigma_p = std::sqrt(P.diagonal().head<3>().maxCoeff());
  const Mat3 attitude = now.x.R * P.block<3, 3>(3, 3) * now.x.R.transpose();
  s.sigma_yaw = std::sqrt(attitude(2, 2));
  return s;
}

}  // namespace epiline
