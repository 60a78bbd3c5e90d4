#include "tests/flights/slow_run.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "drivers/laboratory/simulate/track_simulator.h"
#include "estimator/estimator.h"

namespace epiline::test {
namespace {

constexpr double kLively_s = 15, kSettled_s = 1;  // the slow part begins a second after the lively one
constexpr double kInterval_s = 0.5;               // between two controls of the motion
constexpr std::uint64_t kPathStream = 300;

/// Lively, and then steady, before a wall at the flight's depth.
Flight slow_path(const SlowFlight& f) {
  const double end_s = kLively_s + kSettled_s + f.slow_s;
  Random random(f.seed, kPathStream);
  const double angle = f.direction_deg * std::numbers::pi / 180;
  const Vec3 step = f.speed_m_s * kInterval_s * Vec3(std::cos(angle), std::sin(angle), 0);
  std::vector<Vec3> position, euler;
  Vec3 p = Vec3::Zero(), e = Vec3::Zero();
  Room room{.low = Vec3::Constant(-1e6), .high = Vec3::Constant(1e6), .nearest_share = 0.8};
  for (double t = -kInterval_s; t < end_s + 4 * kInterval_s; t += kInterval_s) {
    if (t < kLively_s) {
      p = 0.7 * p + random.normal3(0.45);
      e = 0.8 * e + random.normal3(1).cwiseProduct(Vec3(0.08, 0.08, 0.15));
      if (t > kLively_s - 2 * kInterval_s) e.setZero();
      room.high.x() = p.x() + f.depth_m;
    } else {
      p += step;
    }
    position.push_back(p);
    euler.push_back(e);
  }
  return {CubicSpline(kInterval_s, std::move(position)), CubicSpline(kInterval_s, std::move(euler)), end_s, room};
}

TrackSimulation simulation_of(const SlowFlight& f) {
  TrackSimulation s;
  s.seed = f.seed;
  s.noise = {.pixel_sigma = f.noise_px};
  if (f.error == TrackError::kDrift) s.noise = {.pixel_sigma = 0, .drift_px = f.noise_px / std::sqrt(10.0)};
  s.loss_share = f.loss_share;
  s.fast_loss_share = 0;
  return s;
}

}  // namespace

SlowVerdict fly_slowly(const SlowFlight& slow, const EstimatorConfig& settings) {
  const TrackSimulation simulation = simulation_of(slow);
  const SimulatedFlight flight = simulate_tracks(simulation, slow_path(slow));
  EstimatorConfig config = settings;
  config.extrinsics = flight.extrinsics;
  config.imu = simulation.imu.noise;
  Estimator estimator(config);
  Supervisor patient;
  const auto frame = std::make_unique<TrackedFrame>();

  SlowVerdict verdict;
  int images = 0, frames = 0, tracking = 0, solved = 0;
  std::uint64_t rest_before = 0;
  Vec3 error_before = Vec3::Zero();
  auto reading = flight.imu.begin();
  for (std::size_t k = 0; k < flight.images.size(); ++k) {
    const SimulatedImage& image = flight.images[k];
    for (; reading != flight.imu.end() && reading->stamp <= image.stamp; ++reading) estimator.add_imu(*reading);
    flight.fill(k, *frame);
    if (k == 0) {
      InitialState start;
      start.p_WB = image.truth.p_WB;
      start.v_WB = image.truth.v_WB;
      start.R_WB = image.truth.R_WB;
      start.b_a = image.truth.b_a;
      start.b_g = image.truth.b_g;
      estimator.start(*frame, start);
      continue;
    }
    const StepResult step = estimator.process(*frame, patient);
    if ((image.stamp - kFlightBegin).seconds() < kLively_s + kSettled_s) continue;
    ++images;
    if (!step.has_pose) continue;
    const Odometry& o = estimator.odometry();
    const Vec3 error = Vec3(o.p_WB_m.data()) - image.truth.p_WB;
    if (frames++ == 0) {
      rest_before = estimator.stats().zero_motion_frames;
      error_before = error;
    }
    const Eigen::Map<const Eigen::Matrix<double, 16, 16>> covariance(o.covariance.data());
    const Eigen::SelfAdjointEigenSolver<Mat3> axes(Mat3(covariance.topLeftCorner<3, 3>()), Eigen::EigenvaluesOnly);
    solved += step.solved;
    verdict.error_m = (error - error_before).norm();
    verdict.sigma_m = std::sqrt(axes.eigenvalues().z());
    if (o.health.state != HealthState::kTracking) continue;
    ++tracking;
    verdict.worst_ratio = std::max(verdict.worst_ratio, verdict.error_m / verdict.sigma_m);
  }
  verdict.rest_share = static_cast<double>(estimator.stats().zero_motion_frames - rest_before) / std::max(1, solved);
  verdict.tracking_share = static_cast<double>(tracking) / std::max(1, images);
  verdict.resets = static_cast<int>(estimator.stats().resets);
  return verdict;
}

}  // namespace epiline::test
