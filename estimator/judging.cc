#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimator/factors/calibration_prior.h"
#include "estimator/impl.h"
#include "estimator/monitor/evidence.h"
#include "estimator/window/keyframe.h"

namespace epiline {

namespace {
constexpr double kMountElsewhere = 0.17;  // rad
constexpr double kDepthKnown_px = 10;     // parallax: the images have a scale to a tenth
constexpr double kSigmaMemory_s = 10;
constexpr double kDriftLeast = 0.02;  // px per root of an image

FoundCalibration found(const Calibration& c, const CalibrationTangent& variances) {
  const Eigen::Quaterniond q(c.R_BC);
  FoundCalibration f{true,
                     c.time_offset,
                     {q.w(), q.x(), q.y(), q.z()},
                     {c.p_BC.x(), c.p_BC.y(), c.p_BC.z()},
                     c.focal_ratio(),
                     c.edge_ratio(),
                     c.scale.accelerometer,
                     c.scale.gyroscope,
                     {}};
  Eigen::Map<CalibrationTangent>(f.sigmas.data()) = variances.cwiseSqrt();
  return f;
}

}  // namespace

/// What the solver claims, with what it cannot know: other maxima of the calibration, and the shape of the lens.
void Estimator::Impl::take_from_solver(const NavState& predicted, double dt_s) {
  carried.P = solver.covariance();
  carried.with_calibration = solver.cross_covariance();
  calibration_covariance = solver.calibration_covariance();
  prior_information = calibration_prior_information(window.calibration_prior,
                                                    local(window.calibration_prior.configured, solver.linearised_at()));
  wheels.watch();
  if (noise.learn_walks(carried.time, carried.x, carried.P)) numbers.forgive_imu();
  resting.solved();
  doubt_origin(predicted, dt_s);
  if (look_far(calibration_covariance, solver.linearised_at(), window.calibration, dt_s, window.calibration_prior))
    flight.rethinking_s = kRethinking_s;
  const LensDoubt of_lens =
      doubt_of_lens(window.calibration_prior, window.calibration, calibration_covariance, window.rig);
  calibration_doubt = growth_by_tails(window.calibration_prior, calibration_covariance) +
                      growth_by_doubt(of_lens, calibration_covariance);
  if (const double factor = intervals.widens(dt_s); factor > 1) widen(carried.x, factor, carried.P);
  carried.P += resting.doubt_of_leaving() + carrying.doubt_of_calibration(carried.with_calibration);
  CalibrationTangent variances = calibration_covariance.diagonal();
  variances.tail<4>() += of_lens;
  stats.calibration = found(window.calibration, variances);
}

/// A window that finds its calibration far off moves: by as much was the origin wrong, which the start called exact.
void Estimator::Impl::doubt_origin(const NavState& predicted, double dt_s) {
  if (flight.rethinking_s <= 0) return;
  flight.rethinking_s -= dt_s;
  const NavState& x = carried.x;
  const double moved = (x.p - predicted.p).norm(), yaw = so3_log(x.R * predicted.R.transpose()).z();
  world.sigma_p = std::hypot(world.sigma_p, moved / std::sqrt(3));
  world.sigma_yaw = std::hypot(world.sigma_yaw, yaw);
}

/// What the window knows was concluded under a rotation of the camera that is now known to be far off.
bool Estimator::Impl::mount_is_elsewhere() const {
  return so3_log(flight.began_R_BC.transpose() * window.calibration.R_BC).norm() > kMountElsewhere;
}

/// `e`: what the caller knows of the frame; the rest is filled in here.
void Estimator::Impl::judge(const TrackedFrame& frame, const SolverSummary& s, FrameEvidence e, double dt_s) {
  const StateCovariance& C = carried.P;
  const NavState& x = carried.x;
  e.solved = true;
  e.tracks = static_cast<int>(frame.features.size());
  for (std::size_t i = 0; i < kMostOthers; ++i)
    if (window.rig.use[i + 1]) e.tracks += static_cast<int>(frame.others[i].alone.size());
  e.gated_share = s.tracks > 0 ? static_cast<double>(s.gated) / s.tracks : 0;
  e.steps_rejected = s.failed();
  e.deadline_missed = s.outcome == SolverOutcome::kOutOfTime;
  e.imu_gap = imu_gap_seen || flight.after_silence_s > 0;
  e.readings_refused = flight.after_refusal_s > 0;
  e.speed = x.v.norm();
  e.sigma_velocity = sigma_velocity(x, C);
  e.sigma_tilt = sigma_tilt(x, C);
  e.bias_accelerometer = x.b_a.norm();
  e.bias_gyroscope = x.b_g.norm();
  e.numbers_wrong = numbers.wrong();
  e.number_named = numbers.is_named();
  e.at_rest = window.newest().at_rest;
  e.parallax_px = flight.parallax_px = widest_parallax_px(window, config.extrinsics.focal_px);
  if (!window.newest().only_images()) flight.depth_known = e.parallax_px > kDepthKnown_px;
  imu_gap_seen = false;
  monitor.update(e, dt_s);
  carried.trusted = monitor.trusts();
}

/// What the solved window's residuals say: whether images and IMU contradict each other, and how large the bearings'
/// noise is.
void Estimator::Impl::learn_from_residuals(const SolverSummary& s, double dt_s) {
  const TrackFit fit = visual->track_fit();
  if (!(fit.median_px > 0)) return;
  constexpr int kMotion = 9;  // numbers of an interval
  numbers.add(fit, s.imu_cost / (kMotion * (window.size() - 1)), dt_s, flight.parallax_px, monitor.settled());
  if (config.estimate_pixel_sigma) adapt_track_noise(fit.median_px, dt_s);
}

/// The scales follow the residuals slowly. Both follow the same figure: white noise of s looks like a drift with steps
/// of s between solved images that are two images apart.
void Estimator::Impl::adapt_track_noise(double seen, double dt_s) {
  const double share = std::min(1.0, dt_s / kSigmaMemory_s);
  flight.tracks.pixel_sigma +=
      share * (std::clamp(seen, kLeastPixelSigma, kMostPixelSigma) - flight.tracks.pixel_sigma);
  flight.tracks.drift_sigma += share * (std::clamp(seen, kDriftLeast, kMostPixelSigma) - flight.tracks.drift_sigma);
}

void Estimator::Impl::count(const SolverSummary& s) {
  const int calibration = (config.estimate_time_offset ? 1 : 0) + (config.estimate_extrinsics ? 6 : 0) +
                          (config.estimate_focal_length ? 1 : 0) + (config.estimate_imu_scale ? kImuScales : 0);
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

}  // namespace epiline
