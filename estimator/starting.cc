#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/factors/beam.h"
#include "estimator/factors/prior.h"
#include "estimator/impl.h"
#include "estimator/initialise/moving_start.h"
#include "estimator/initialise/stationary_start.h"
#include "estimator/monitor/evidence.h"
#include "estimator/predict/covariance.h"
#include "estimator/window/choose_tracks.h"

namespace epiline {

namespace {
// A start in motion is taken when the window's own posterior says so.
constexpr int kStartSteps = 10;
constexpr int kStartWindow = 11;  // images; from ten on they show that tracks are worse than configured
// If that is too little. The rest of the window is for the flight's first frames: before they have corrected the scale,
// a frame that leaves would make the prior claim a wrong one.
constexpr int kLongStartWindow = kMaxFrames - kRecentFrames;
// Of a wrong scale the next images soon show another one.
constexpr int kSteadyStarts = 4;       // attempts in a row of one velocity, if it took more time than a usual window
constexpr double kSurelyKnown = 0.05;  // relative: as a settled flight's speed, need not be steady
constexpr double kLongestStart_s = 4;  // that the images may span
constexpr double kLongLook_s = 3;      // that show how much better than configured the tracks are
constexpr double kStartVelocity = 0.2, kStartTilt = 0.035, kStartScale = 0.15;  // m/s, rad, relative
constexpr double kStartBeamMisfit = 1;                                      // squared sigmas; of right ones 0.02 to 0.3
constexpr double kStartResidual = 1.6;                                      // bearing noise seen over that assumed
constexpr double kBiasSigmaGyroscope = 0.1, kBiasSigmaAccelerometer = 0.1;  // before the first start
constexpr double kBiasSigmaGyroscopeKnown = 0.01;                           // before a start after a good run

/// The state fits the images, but they do not say enough.
bool is_uncertain(StartRefusal r) {
  return r == StartRefusal::kScaleUncertain || r == StartRefusal::kVelocityUncertain ||
         r == StartRefusal::kTiltUncertain;
}

/// The frame between the two that are closest to each other, the older one of several.
int most_crowded(const Window& w) {
  const auto room = [&](int k) { return w.at(k + 1).time - w.at(k - 1).time; };
  int found = 1;
  for (int k = 2; k + 1 < w.size(); ++k)
    if (room(k) < room(found)) found = k;
  return found;
}

/// Mean robust cost of the distances of a range finder, in squared sigmas.
double beam_misfit(const Window& w) {
  int distances = 0;
  for (int k = 0; k < w.size(); ++k) distances += w.at(k).beam.variance > 0 ? 1 : 0;
  return distances > 0 ? add_beam(w, {w.size(), false}, nullptr) / distances : 0;
}

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
  if (window.size() >= (attempt.lacks_time ? kLongStartWindow : std::max(kStartWindow, window.capacity()))) make_room();
  if (!cut(frame)) {
    window.clear();
    ++stats.start_refused[static_cast<int>(StartRefusal::kNoImu)];
    return {};
  }
  if (window.size() == 1) {
    window.newest().x.b_g = known_gyroscope_bias();
    attempt.before = carrying.to(window.newest().time);
  }
  const auto refusal = try_start(frame, supervisor);
  attempt.lacks_time = refusal && is_uncertain(*refusal);
  if (refusal) {
    ++stats.start_refused[static_cast<int>(*refusal)];
    window.prune();
    return {};
  }
  flight.may_slide = true;
  return {true, true};
}

/// For another frame. Where the last start failed only because its images say too little, they are to span more time:
/// the frame leaves that is closest to its neighbours. Otherwise the images may be wrong, and the oldest leaves.
void Estimator::Impl::make_room() {
  const double span_s = (window.newest().time - window.at(0).time).seconds();
  const int leaving = attempt.lacks_time && span_s < kLongestStart_s ? most_crowded(window) : 0;
  if (leaving > 0 && drop(leaving)) return;
  attempt.before = carrying.on_to(attempt.before, window.at(1).time);
  window.remove(0);
}

/// Whether something is left of the flight before.
bool Estimator::Impl::knows_oldest() const {
  return attempt.before.known && attempt.before.trusted && attempt.before.P.allFinite() &&
         attempt.before.time == window.at(0).time;
}

/// Of the oldest frame: from before the start, and by the wheels.
void Estimator::Impl::add_known_velocity(StarterSettings& s) const {
  if (knows_oldest()) {
    const NavState& x = attempt.before.x;
    s.v_B = x.R.transpose() * x.v;
    Eigen::Matrix<double, 3, 6> J;  // by (dtheta, dv)
    J << skew(s.v_B), x.R.transpose();
    const Mat3 C = J * attempt.before.P.block<6, 6>(3, 3) * J.transpose();
    s.v_B_information = (C + 1e-4 * Mat3::Identity()).inverse();
  }
  const auto wheel = wheels.speed_of(window.at(0));
  if (!wheel) return;
  const Vec3& e = window.wheel.forward_B;
  const Vec3 sum = s.v_B_information * s.v_B + wheel->information * wheel->m_s * e;
  s.v_B_information += wheel->information * e * e.transpose();
  s.v_B = s.v_B_information.ldlt().solve(sum);
}

/// A prior on the oldest frame from before the start. Place and heading are those of the guess, since they define the
/// world, and how far off they may be is `world`.
void Estimator::Impl::set_known_prior() {
  NavState x = attempt.before.x;
  StateCovariance P = attempt.before.P;
  const Mat3 turn = so3_exp(Vec3(0, 0, heading_from(x.R, window.at(0).x.R)));
  x.p = window.at(0).x.p;
  x.v = turn * x.v;
  x.R = turn * x.R;
  P.middleRows<3>(6) = (turn * P.middleRows<3>(6)).eval();
  P.middleCols<3>(6) = (P.middleCols<3>(6) * turn.transpose()).eval();
  P = without_origin(x, P);
  const InitialState exact;
  const Vec3 up_B = x.R.transpose() * Vec3::UnitZ();
  P.topLeftCorner<3, 3>().diagonal().setConstant(exact.sigma_p * exact.sigma_p);
  P.block<3, 3>(3, 3) += exact.sigma_yaw * exact.sigma_yaw * up_B * up_B.transpose();
  set_prior(window, {.P = P, .time_offset_sigma = calibration_sigmas()[kTimeOffsetColumn]});
  window.prior.x0[0] = x;
}

std::optional<StartRefusal> Estimator::Impl::try_start(const TrackedFrame& frame, Supervisor& supervisor) {
  resting.watch(frame, flight.tracks.pixel_sigma);
  if (numbers.wrong_at_rest() == Severity::kGross) return StartRefusal::kNumbersWrong;
  ++stats.start_attempts;
  if (!start_at_rest(frame)) return std::nullopt;
  if (numbers.wrong() == Severity::kGross) return StartRefusal::kNumbersWrong;
  return start_moving(frame, supervisor);
}

std::optional<StartRefusal> Estimator::Impl::start_at_rest(const TrackedFrame& frame) {
  const auto readings = resting.at_rest(wheels.motion());
  if (!readings) return StartRefusal::kNoParallax;
  if (const double force = readings->mean_specific_force.norm(); !can_be_gravity(force)) {
    numbers.refuse_force(force);
    return StartRefusal::kNumbersWrong;
  }
  InitialState state;
  const auto refusal = solve_stationary_start(*readings, noise.of_readings(), kBiasSigmaAccelerometer, state);
  if (refusal) return refusal;
  numbers.stands();
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
  if (sigma_velocity(x, C) > std::max(kStartVelocity, kStartScale * x.v.norm()))
    return StartRefusal::kVelocityUncertain;
  const Vec3 path = x.p - window.at(0).x.p;
  const double length = path.norm();
  if (length > 0) {
    const Vec3 along = path / length;
    if (std::sqrt(along.dot(C.block<3, 3>(0, 0) * along)) > kStartScale * length) return StartRefusal::kScaleUncertain;
  }
  return std::nullopt;
}

std::optional<StartRefusal> Estimator::Impl::start_moving(const TrackedFrame& frame, Supervisor& supervisor) {
  wheels.attach();
  StarterSettings at = starter_settings();
  at.depth_is_measured = window.size() >= kStartWindow && heights.has_range_finder();
  add_known_velocity(at);
  const Calibration before = window.calibration;
  const auto unfit = starter.start_moving(window, at);
  attempt.steady = starter.guess().moved < kStartScale ? attempt.steady + 1 : 0;
  if (unfit) return unfit;
  const bool is_long = (window.newest().time - window.at(0).time).seconds() > kStartWindow * config.solve_interval_s;
  if (is_long && starter.guess().sigma_scale > kSurelyKnown && attempt.steady < kSteadyStarts)
    return StartRefusal::kScaleUncertain;
  if (knows_oldest()) set_known_prior();
  const double given_sigma = flight.tracks.pixel_sigma;
  flight.tracks.pixel_sigma = starter.guess().noise_rad * config.extrinsics.focal_px;
  flight.began_at = window.at(0).time;
  const Heights::Memory heights_before = heights.memory();
  if (at.depth_is_measured) heights.attach(flight.tracks.pixel_sigma);
  wheels.find_slips();
  intervals.follow_biases();
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
  // distances far from what the tracks near the beam show are outliers to the window, and would leave it at a false
  // scale
  if (!refusal && beam_misfit(window) > kStartBeamMisfit) refusal = StartRefusal::kScaleUncertain;
  const double seen = visual->track_fit().median_px;
  if (!refusal && seen > kStartResidual * flight.tracks.pixel_sigma) refusal = StartRefusal::kResidualTooLarge;
  if (refusal) {
    flight.tracks.pixel_sigma = given_sigma;
    take_back_start(before);
    heights.restore(heights_before);
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
  for (int k = 0; k < window.size(); ++k) {
    Slot& s = window.at(k);
    s.x = NavState{.b_g = b_g};
    s.heights = {};
    s.beam = {};
    s.path_m = -1;
  }
  intervals.follow_biases();
  window.calibration = before;
}

/// The window has states from its oldest frame on.
void Estimator::Impl::began(StartKind kind) {
  monitor.begin(kind == StartKind::kCarried);
  started = true;
  flight.began_R_BC = window.calibration.R_BC;
  flight.rejected_last = false;
  flight.began_at = flight.last_marginalised = window.at(0).time;
  resting.begin();
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
  // images of a vehicle that is shaken would not show for a second what is known: that it stands
  const bool stands_shaken = kind == StartKind::kStationary && noise.shakes();
  window.clear();
  visual->restart();
  if (!stands_shaken) resting.forget();
  cut(frame);
  Slot& s = window.newest();
  s.x.p = state.p_WB;
  s.x.v = state.v_WB;
  s.x.R = state.R_WB;
  s.x.b_a = state.b_a;
  s.x.b_g = state.b_g;
  set_initial_prior(window, state, calibration_sigmas());
  began(kind);
  if (stands_shaken) resting.begin_at_rest();
  remember_origin();
  carried = {true, true, s.time, s.x, s.omega, covariance_of(state, config.time_offset_sigma_s)};
  publish(frame.stamp, carried);
}

Vec3 Estimator::Impl::known_gyroscope_bias() const {
  return carried.known && carried.trusted ? carried.x.b_g : Vec3(Vec3::Zero());
}

/// For a start at the window's newest frame.
StarterSettings Estimator::Impl::starter_settings() const {
  StarterSettings s;
  s.pixel_sigma = flight.tracks.pixel_sigma;
  const bool looked_long = (window.newest().time - window.at(0).time).seconds() > kLongLook_s;
  s.least_pixel_sigma = config.estimate_pixel_sigma && looked_long
                            ? std::min(kLeastPixelSigma, flight.tracks.pixel_sigma)
                            : flight.tracks.pixel_sigma;
  s.most_pixel_sigma = config.estimate_pixel_sigma ? kMostPixelSigma : flight.tracks.pixel_sigma;
  s.focal_px = config.extrinsics.focal_px;
  s.b_g_sigma = kBiasSigmaGyroscope;
  s.b_a_sigma = kBiasSigmaAccelerometer;
  s.calibration_sigmas = calibration_sigmas();
  if (!carried.known) return s;
  if (carried.trusted) s.b_g_sigma = kBiasSigmaGyroscopeKnown;
  s.b_g_reference = known_gyroscope_bias();
  const KnownState now = carrying.to(window.newest().time);
  s.p_WB = now.x.p;
  s.R_WB = now.x.R;
  const StateCovariance P = now.P + covariance_added(world, now.x);
  s.sigma_p = std::sqrt(P.diagonal().head<3>().maxCoeff());
  const Mat3 attitude = now.x.R * P.block<3, 3>(3, 3) * now.x.R.transpose();
  s.sigma_yaw = std::sqrt(attitude(2, 2));
  return s;
}

}  // namespace epiline
