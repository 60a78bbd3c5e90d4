#pragma once
// Made-up flights through the whole estimator.
#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "estimator/estimator.h"
#include "tests/estimator/made_up_time.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {

/// Stands still until `moving_from`, gets going within a second, and then follows a smooth path. World: z up.
struct Flight {
  double moving_from = 1e9;
  Vec3 b_g = Vec3(0.02, -0.015, 0.03), b_a = Vec3(0.05, -0.04, 0.03);
  SyntheticPath path{1};
  double pace = 1;  ///< along the path

  double warped(double t) const {
    const double s = t - moving_from;
    if (s <= 0) return 0;
    // the integral of a smooth step from 0 to 1
    return pace * (s < 1 ? s * s * s * s * (2.5 - 3 * s + s * s) : s - 0.5);
  }
  Vec3 p(double t) const { return path.p(warped(t)); }
  Mat3 R(double t) const { return so3_exp(Vec3(0.1, -0.15, 0)) * path.R(warped(t)); }
  Vec3 v(double t) const {
    constexpr double h = 1e-4;
    return (8 * (p(t + h) - p(t - h)) - (p(t + 2 * h) - p(t - 2 * h))) / (12 * h);
  }
  Vec3 rate(double t) const {
    constexpr double h = 1e-4;
    return so3_log(R(t - h).transpose() * R(t + h)) / (2 * h);
  }
  Vec3 force(double t) const {
    constexpr double h = 1e-3;
    const Vec3 a = (16 * (p(t + h) + p(t - h)) - (p(t + 2 * h) + p(t - 2 * h)) - 30 * p(t)) / (12 * h * h);
    return R(t).transpose() * (a - kGravity_W);
  }
};

/// As a tracker does that has lost all: the same points under other names. `times`: how often it has lost them.
inline void rename_tracks(std::uint32_t times, TrackedFrame& frame) {
  for (TrackedFeature& f : frame.features) f.id += 1000 * times;
}

/// Feeds an estimator with a flight: IMU at 200 Hz, images at 20 Hz unless told, points on a shell around the start.
class Rig {
 public:
  /// `lever_arm_error`: of the configured place of the camera, m.
  Rig(const Flight& flight, EstimatorConfig config, std::size_t points = 900,
      const Vec3& lever_arm_error = Vec3::Zero())
      : flight_(flight), calibration_(synthetic_calibration()) {
    config.extrinsics.R_BC = calibration_.R_BC;
    config.extrinsics.p_BC = calibration_.p_BC + lever_arm_error;
    config.extrinsics.focal_px = kFocal;
    estimator_ = std::make_unique<Estimator>(config);
    std::uniform_real_distribution<double> u(-1, 1);
    while (points_.size() < points) {
      const Vec3 d(u(random_), u(random_), u(random_));
      if (d.norm() < 1 && d.norm() > 0.1) points_.push_back(d.normalized() * (5 + 2.5 * u(random_)));
    }
  }

  Estimator& estimator() { return *estimator_; }
  const Odometry& odometry() const { return estimator_->odometry(); }
  const EstimatorStats& stats() const { return estimator_->stats(); }
  const StepResult& last() const { return last_; }
  double now() const { return image_period_s * frame_; }

  std::function<void(const ImuSample&)> before_imu;  ///< may add others through estimator()
  bool camera = true, features = true, imu = true;
  double image_period_s = 0.05, imu_period_s = 0.005;
  HostStamp begin = at(0);
  double imu_delay_s = -0.01;       ///< of the newest reading before a frame; negative: readings are ahead
  double pixel_noise = 0.3;         ///< px, of every bearing
  double wandering_share = 0;       ///< of the tracks: they leave the point they began at, 5 px an image ...
  double wandering_from = 0;        ///< ... from this second on
  Vec3 force_signs = Vec3::Ones();  ///< of the accelerometer's axes
  double time_offset = 0;           ///< s: the camera's stamps are early by so much
  std::size_t most_features = 10'000;
  std::function<void(TrackedFrame&)> spoil;
  Supervisor* supervisor = &patient_;

  /// Until `seconds` of the flight; `each` after every frame.
  void run_to(double seconds, const std::function<void()>& each = {}) {
    while (now() < seconds - 1e-9) {
      ++frame_;
      push_readings();
      if (!camera) continue;
      image(now());
      if (spoil) spoil(image_);
      last_ = estimator_->process(image_, *supervisor);
      if (each) each();
    }
  }

  /// At the first image, from a state that is known.
  void start(const InitialState& state) {
    push_readings();
    estimator_->start(image(now()), state);
  }

  const TrackedFrame& image(double t) {
    image_.stamp = begin + Span::from_seconds(t - time_offset);
    image_.features.clear();
    std::normal_distribution<double> normal(0, pixel_noise);
    for (std::size_t i = 0; features && i < points_.size() && image_.features.size() < most_features; ++i) {
      const Vec3 X = in_camera(points_[i], t);
      if (X.z() < 0.5 || std::abs(X.x()) > 0.8 * X.z() || std::abs(X.y()) > 0.6 * X.z()) continue;
      Vec2 noise(normal(random_), normal(random_));
      if (t >= wandering_from && wanders(i)) noise += wander(i);
      image_.features.push_back(make_feature(static_cast<std::uint32_t>(i), X, noise));
    }
    return image_;
  }

  // errors against the truth, now
  Mat3 R() const {
    const auto& q = odometry().q_WB;
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  }
  Vec3 p() const { return Vec3(odometry().p_WB_m.data()); }
  Vec3 v() const { return Vec3(odometry().v_WB_m_s.data()); }
  double tilt_error() const {
    const Vec3 up = R().transpose() * Vec3(0, 0, 1), truth = flight_.R(now()).transpose() * Vec3(0, 0, 1);
    return up.cross(truth).norm();
  }
  /// Of the velocity in the body: needs no common yaw.
  double velocity_error() const {
    return (R().transpose() * v() - flight_.R(now()).transpose() * flight_.v(now())).norm();
  }
  double gyroscope_bias_error() const { return (Vec3(odometry().gyroscope_bias_rad_s.data()) - flight_.b_g).norm(); }
  double sigma(int row) const { return std::sqrt(odometry().covariance[static_cast<std::size_t>(17 * row)]); }
  double sigma_velocity() const { return std::max({sigma(6), sigma(7), sigma(8)}); }
  double sigma_yaw() const {
    const Mat3 attitude = Eigen::Map<const StateCovariance>(odometry().covariance.data()).block<3, 3>(3, 3);
    return std::sqrt((R() * attitude * R().transpose())(2, 2));
  }
  double sigma_position() const { return std::max({sigma(0), sigma(1), sigma(2)}); }
  bool has(HealthReason r) const { return odometry().health.reasons & static_cast<std::uint32_t>(r); }

 private:
  /// Evenly among the points.
  bool wanders(std::size_t i) const {
    const auto wandering = [&](std::size_t n) { return std::floor(static_cast<double>(n) * wandering_share); };
    return wandering(i + 1) > wandering(i);
  }
  const Vec2& wander(std::size_t i) {
    std::normal_distribution<double> step(0, 5);  // px
    wandered_.resize(points_.size(), Vec2::Zero());
    return wandered_[i] += Vec2(step(random_), step(random_));
  }
  Vec3 in_camera(const Vec3& P, double t) const {
    return calibration_.R_BC.transpose() * (flight_.R(t).transpose() * (P - flight_.p(t)) - calibration_.p_BC);
  }
  void push_readings() {
    for (; imu_ * imu_period_s <= now() - imu_delay_s; ++imu_)
      if (imu) push_imu(imu_ * imu_period_s);
  }
  void push_imu(double t) {
    std::normal_distribution<double> normal(0, 1 / std::sqrt(imu_period_s));
    auto noise = [&](double density) {
      return Vec3(density * normal(random_), density * normal(random_), density * normal(random_));
    };
    const ImuNoise n;
    ImuSample sample;
    sample.stamp = begin + Span::from_seconds(t);
    Eigen::Map<Vec3>(sample.angular_velocity_rad_s.data()) = flight_.rate(t) + flight_.b_g + noise(n.gyroscope_density);
    Eigen::Map<Vec3>(sample.specific_force_m_s2.data()) =
        force_signs.cwiseProduct(flight_.force(t) + flight_.b_a + noise(n.accelerometer_density));
    if (before_imu) before_imu(sample);
    estimator_->add_imu(sample);
  }

  Flight flight_;
  Calibration calibration_;
  std::unique_ptr<Estimator> estimator_;
  Supervisor patient_;
  std::mt19937_64 random_{7};
  std::vector<Vec3> points_;
  std::vector<Vec2> wandered_;
  TrackedFrame image_;
  StepResult last_;
  int frame_ = 0, imu_ = 0;
};

/// Position and heading in the truth's world, when the world was the same at `then`.
struct Displaced {
  Vec3 p;
  double yaw_deg;
};
inline Displaced error_since(const Rig& rig, const Flight& flight, double then, const Vec3& p_then,
                             const Mat3& R_then) {
  // the truth moved into the estimator's world at `then`, by heading and position
  const auto yaw = [](const Mat3& R) { return std::atan2(R(1, 0), R(0, 0)); };
  const Mat3 turn = so3_exp(Vec3(0, 0, yaw(R_then) - yaw(flight.R(then))));
  const Vec3 p = p_then + turn * (flight.p(rig.now()) - flight.p(then));
  const double heading = yaw(R_then) - yaw(flight.R(then)) + yaw(flight.R(rig.now()));
  return {rig.p() - p, std::remainder(yaw(rig.R()) - heading, 2 * M_PI) * 180 / M_PI};
}

}  // namespace epiline::test
