#include "tests/flights/simulated_run.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>

#include "drivers/flights/motion/random.h"
#include "drivers/study/evaluate/errors.h"
#include "estimator/geometry/so3.h"
#include "pipeline/stages/imu_feed.h"
#include "tests/flights/fault_run.h"

namespace epiline {
namespace {

constexpr std::uint64_t kStartStream = 100;
constexpr std::size_t kImagesPerFrame = 2;

/// Ground truth plus a random error with the standard deviations that the estimator is configured for.
InitialState wrong_start(const BodyState& truth, std::uint64_t seed) {
  Random random(seed, kStartStream);
  InitialState x;
  x.p_WB = truth.p_WB + random.normal3(x.sigma_p);
  const Vec3 rotation_W = random.normal3(1).cwiseProduct(Vec3(x.sigma_tilt, x.sigma_tilt, x.sigma_yaw));
  x.R_WB = so3_exp(rotation_W) * truth.R_WB;
  x.v_WB = truth.v_WB + random.normal3(x.sigma_v);
  x.b_a = truth.b_a + random.normal3(x.sigma_b_a);
  x.b_g = truth.b_g + random.normal3(x.sigma_b_g);
  return x;
}

/// Gives the estimator the flight's IMU readings, as far as each frame needs them.
class SimulatedImu {
 public:
  SimulatedImu(const SimulatedFlight& flight, Estimator& estimator) : flight_(flight), estimator_(estimator) {}
  /// False: the flight's readings end before.
  bool up_to(HostStamp needed) {
    while (feed_.wants_more(needed)) {
      if (next_ == flight_.imu.size()) return false;
      const ImuSample& sample = flight_.imu[next_++];
      estimator_.add_imu(sample);
      feed_.took(sample);
    }
    return true;
  }

 private:
  const SimulatedFlight& flight_;
  Estimator& estimator_;
  ImuFeed feed_;
  std::size_t next_ = 0;
};

/// Normalised estimation error squared of three coordinates, per degree of freedom. `first`: their place in
/// Odometry::covariance.
double nees(const Odometry& odometry, int first, const Vec3& error) {
  const Eigen::Map<const Eigen::Matrix<double, 16, 16, Eigen::RowMajor>> covariance(odometry.covariance.data());
  const Mat3 C = covariance.block<3, 3>(first, first);
  return error.dot(C.ldlt().solve(error)) / 3;
}

/// Estimates and truths of one run, and what they say.
class Record {
 public:
  /// False: the run has diverged.
  bool add(const Odometry& odometry, const Motion& truth) {
    if (!truth_.poses.empty()) path_m_ += (truth.p_WB - truth_.poses.back().p_WB).norm();
    estimate_.poses.push_back(test::pose_of(odometry));
    truth_.poses.push_back({odometry.stamp, truth.p_WB, Eigen::Quaterniond(truth.R_WB)});
    return (estimate_.poses.back().p_WB - truth.p_WB).norm() <= std::max(2.0, 0.1 * path_m_);
  }

  void judge_covariance(const Odometry& odometry) {
    const TimedPose &estimate = estimate_.poses.back(), &truth = truth_.poses.back();
    nees_position_ += nees(odometry, 0, truth.p_WB - estimate.p_WB);
    nees_rotation_ += nees(odometry, 3, so3_log((estimate.q_WB.conjugate() * truth.q_WB).toRotationMatrix()));
    ++judged_;
  }

  void finish(RunFigures& figures) const {
    figures.ate_m = evaluate(estimate_, truth_).ate_4dof.rmse;
    figures.nees_position = nees_position_ / std::max(1, judged_);
    figures.nees_rotation = nees_rotation_ / std::max(1, judged_);
  }

 private:
  Trajectory estimate_, truth_;
  double path_m_ = 0, nees_position_ = 0, nees_rotation_ = 0;
  int judged_ = 0;
};

}  // namespace

EstimatorConfig known_config(const TrackSimulation& simulation) {
  EstimatorConfig config;
  config.solve_interval_s = 0.05;
  config.pixel_sigma = std::max(0.3, simulation.noise.pixel_sigma);
  config.estimate_pixel_sigma = false;
  config.sigma_inflation = 1;
  config.track_noise = TrackNoiseModel::kWhite;  // as the simulated tracks have it
  config.imu = simulation.imu.noise;
  config.gyroscope_density_factor = config.accelerometer_density_factor = config.accelerometer_walk_factor = 1;
  config.extrinsics = true_extrinsics(simulation);
  config.estimate_time_offset = false;
  return config;
}

RunFigures run_simulated(const SimulatedFlight& flight, const EstimatorConfig& config, std::uint64_t seed) {
  constexpr std::size_t kImagesPerJudgement = 20;
  constexpr double kJudgeAfter_s = 5;
  Estimator estimator(config);
  Supervisor supervisor;  // lets the solver finish
  SimulatedImu imu(flight, estimator);
  const auto frame = std::make_unique<TrackedFrame>();
  RunFigures figures;
  Record record;

  flight.fill(0, *frame);
  imu.up_to(estimator.imu_needed_until(frame->stamp));
  estimator.start(*frame, wrong_start(flight.images[0].truth, seed));
  for (std::size_t k = kImagesPerFrame; k < flight.images.size(); k += kImagesPerFrame) {
    flight.fill(k, *frame);
    if (!imu.up_to(estimator.imu_needed_until(frame->stamp))) break;
    const StepResult step = estimator.process(*frame, supervisor);
    const Odometry& odometry = estimator.odometry();
    const Motion truth = flight.truth_at(odometry.stamp);
    const bool alive = step.has_pose && estimator.stats().resets == 0 && record.add(odometry, truth);
    const double seconds = (flight.images[k].stamp_true - kFlightBegin).seconds();
    if (!alive) {
      figures.diverged = true;
      figures.diverged_at_s = seconds;
      break;
    }
    if (k % kImagesPerJudgement == 0 && seconds > kJudgeAfter_s) record.judge_covariance(odometry);
  }
  record.finish(figures);
  return figures;
}

RunFigures mean_of_runs(TrackSimulation simulation, int runs, const std::function<void(EstimatorConfig&)>& alter) {
  RunFigures mean;
  for (int run = 1; run <= runs; ++run) {
    simulation.seed = static_cast<std::uint64_t>(run);
    EstimatorConfig config = known_config(simulation);
    alter(config);
    const RunFigures one = run_simulated(simulate_tracks(simulation), config, simulation.seed);
    mean.diverged |= one.diverged;
    mean.diverged_at_s = std::max(mean.diverged_at_s, one.diverged_at_s);
    mean.ate_m += one.ate_m / runs;
    mean.nees_position += one.nees_position / runs;
    mean.nees_rotation += one.nees_rotation / runs;
  }
  return mean;
}

}  // namespace epiline
