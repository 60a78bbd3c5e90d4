// The estimator as a whole on made-up flights: how it starts, what it says of itself, what it does when the camera or
// the IMU misbehave, and that it never asks for memory.
#include "estimator/estimator.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "platform/memory/allocation_count.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

/// Stands still until `moving_from`, gets going within a second, and then follows a smooth path. World: z up.
struct Flight {
  double moving_from = 1e9;
  Vec3 b_g = Vec3(0.02, -0.015, 0.03), b_a = Vec3(0.05, -0.04, 0.03);
  SyntheticPath path{1};

  double warped(double t) const {
    const double s = t - moving_from;
    if (s <= 0) return 0;
    // the integral of a smooth step from 0 to 1
    return s < 1 ? s * s * s * s * (2.5 - 3 * s + s * s) : s - 0.5;
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

HostStamp at(double seconds) { return HostStamp{} + Span::from_seconds(100 + seconds); }

/// Feeds an estimator with a flight: IMU at 200 Hz, images at 20 Hz, points on a shell around the start.
class Rig {
 public:
  Rig(const Flight& flight, EstimatorConfig config) : flight_(flight), calibration_(synthetic_calibration()) {
    config.extrinsics.R_BC = calibration_.R_BC;
    config.extrinsics.p_BC = calibration_.p_BC;
    config.extrinsics.focal_px = kFocal;
    estimator_ = std::make_unique<Estimator>(config);
    std::uniform_real_distribution<double> u(-1, 1);
    while (points_.size() < 900) {
      const Vec3 d(u(random_), u(random_), u(random_));
      if (d.norm() < 1 && d.norm() > 0.1) points_.push_back(d.normalized() * (5 + 2.5 * u(random_)));
    }
  }

  Estimator& estimator() { return *estimator_; }
  const Odometry& odometry() const { return estimator_->odometry(); }
  const EstimatorStats& stats() const { return estimator_->stats(); }
  const StepResult& last() const { return last_; }
  double now() const { return 0.05 * frame_; }

  std::function<void(const ImuSample&)> before_imu;  ///< may add others through estimator()
  bool camera = true, features = true, imu = true;
  std::function<void(TrackedFrame&)> spoil;
  Supervisor* supervisor = &patient_;

  /// Until `seconds` of the flight; `each` after every frame.
  void run_to(double seconds, const std::function<void()>& each = {}) {
    while (now() < seconds - 1e-9) {
      ++frame_;
      for (; imu_ * 0.005 <= now() + 0.01; ++imu_)
        if (imu) push_imu(imu_ * 0.005);
      if (!camera) continue;
      image(now());
      if (spoil) spoil(image_);
      last_ = estimator_->process(image_, *supervisor);
      if (each) each();
    }
  }

  const TrackedFrame& image(double t) {
    image_.stamp = at(t);
    image_.features.clear();
    std::normal_distribution<double> normal(0, 0.3);  // px
    for (std::size_t i = 0; features && i < points_.size(); ++i) {
      const Vec3 X = in_camera(points_[i], t);
      if (X.z() < 0.5 || std::abs(X.x()) > 0.8 * X.z() || std::abs(X.y()) > 0.6 * X.z()) continue;
      const Vec2 noise(normal(random_), normal(random_));
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
  double sigma_position() const { return std::max({sigma(0), sigma(1), sigma(2)}); }
  bool has(HealthReason r) const { return odometry().health.reasons & static_cast<std::uint32_t>(r); }

 private:
  Vec3 in_camera(const Vec3& P, double t) const {
    return calibration_.R_BC.transpose() * (flight_.R(t).transpose() * (P - flight_.p(t)) - calibration_.p_BC);
  }
  void push_imu(double t) {
    std::normal_distribution<double> normal(0, 1 / std::sqrt(0.005));
    auto noise = [&](double density) {
      return Vec3(density * normal(random_), density * normal(random_), density * normal(random_));
    };
    const ImuNoise n;
    ImuSample sample;
    sample.stamp = at(t);
    Eigen::Map<Vec3>(sample.angular_velocity_rad_s.data()) = flight_.rate(t) + flight_.b_g + noise(n.gyroscope_density);
    Eigen::Map<Vec3>(sample.specific_force_m_s2.data()) =
        flight_.force(t) + flight_.b_a + noise(n.accelerometer_density);
    if (before_imu) before_imu(sample);
    estimator_->add_imu(sample);
  }

  Flight flight_;
  Calibration calibration_;
  std::unique_ptr<Estimator> estimator_;
  Supervisor patient_;
  std::mt19937_64 random_{7};
  std::vector<Vec3> points_;
  TrackedFrame image_;
  StepResult last_;
  int frame_ = 0, imu_ = 0;
};

TEST(EstimatorStart, AtRestGivesAttitudeAndBiasWithinASecond) {
  // GIVEN a robot that stands still, tilted, with biased sensors
  Rig rig({}, {});
  EXPECT_TRUE(rig.has(HealthReason::kNoInitialState));
  double first_pose = -1;
  // WHEN a second has passed
  rig.run_to(1, [&] {
    if (first_pose < 0 && rig.last().has_pose) first_pose = rig.now();
  });
  // THEN it has started, knows its tilt and gyroscope bias as well as it says, and does not claim to move
  ASSERT_TRUE(rig.last().has_pose);
  EXPECT_EQ(rig.stats().start_kind, StartKind::kStationary);
  EXPECT_LT(first_pose, 1);
  EXPECT_LT(rig.tilt_error(), 0.012);  // an accelerometer bias of 0.06 m/s^2 is 0.006 rad
  EXPECT_LT(rig.tilt_error(), 4 * std::max(rig.sigma(3), rig.sigma(4)));
  EXPECT_LT(rig.gyroscope_bias_error(), 2e-3);
  EXPECT_LT(rig.velocity_error(), 0.05);
  EXPECT_LT(rig.velocity_error(), 4 * rig.sigma_velocity());
  // AND stays there, healthy: a cost that is rough for want of parallax is no reason to worry
  int frames = 0, unwell = 0;
  rig.run_to(12, [&] {
    ++frames;
    unwell += rig.now() > 2 && rig.odometry().health.state != HealthState::kTracking;
  });
  EXPECT_LT(unwell, frames / 10);
  EXPECT_GT(rig.stats().zero_motion_frames, 50u);
  EXPECT_LT(rig.p().norm(), 0.01);
}

TEST(EstimatorStart, InMotionFindsScaleVelocityAndTilt) {
  // GIVEN a robot that has been on its way for two seconds when the estimator is switched on
  Rig rig({.moving_from = -2}, {});
  double first_pose = -1;
  int overconfident = 0;
  // WHEN it flies on
  rig.run_to(8, [&] {
    if (!rig.last().has_pose) return;
    if (first_pose < 0) first_pose = rig.now();
    if (rig.odometry().health.state == HealthState::kTracking && rig.velocity_error() > 0.3) ++overconfident;
  });
  // THEN it starts without a rest, within four seconds, and says "tracking" only when it is
  ASSERT_GT(first_pose, 0);
  EXPECT_EQ(rig.stats().start_kind, StartKind::kMoving);
  EXPECT_LT(first_pose, 4);
  EXPECT_EQ(overconfident, 0);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT(rig.velocity_error(), 0.06);
  EXPECT_LT(rig.tilt_error(), 0.01);
  EXPECT_LT(rig.gyroscope_bias_error(), 2e-3);
  EXPECT_EQ(rig.stats().resets, 0u);
}

TEST(EstimatorFeatures, TwoSecondsWithoutThemAreDegradedAndTheCovarianceCoversTheDrift) {
  // GIVEN a flight that is going well
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(8);
  ASSERT_EQ(rig.odometry().health.state, HealthState::kTracking);
  const double sigma_before = rig.sigma_position();
  const Mat3 align = rig.R() * flight.R(rig.now()).transpose();
  const Vec3 p0 = rig.p(), truth0 = flight.p(rig.now());
  // WHEN two seconds of images show nothing
  rig.features = false;
  rig.run_to(10, [&] {
    ASSERT_TRUE(rig.last().has_pose);
    // THEN poses go on and the health says so
    EXPECT_NE(rig.odometry().health.state, HealthState::kLost) << rig.now();
    if (rig.last().solved) {
      EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded) << rig.now();
      EXPECT_TRUE(rig.has(HealthReason::kFewTracks));
    }
  });
  // AND the covariance has grown and covers the drift
  const double drift = (rig.p() - p0 - align * (flight.p(rig.now()) - truth0)).norm();
  EXPECT_LT(drift, 4 * rig.sigma_position());
  EXPECT_GT(rig.sigma_position(), 1.5 * sigma_before);
  EXPECT_EQ(rig.stats().resets, 0u);
  // AND when they come back, it is tracking again
  rig.features = true;
  rig.run_to(13);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT(rig.velocity_error(), 0.05);
}

TEST(EstimatorImu, BadSamplesAreCountedAndHarmless) {
  // GIVEN two estimators on the same flight, one of which gets not-a-numbers, impossible values, doubles, old samples
  // and stamps far in the future as well
  const Flight flight{.moving_from = 1.5};
  Rig clean(flight, {}), spoilt(flight, {});
  std::uint64_t n = 0, refused = 0;
  spoilt.before_imu = [&](const ImuSample& good) {
    ImuSample bad = good;
    switch (++n % 10) {
      case 1:
        bad.stamp = bad.stamp + Span{1'000'000};
        bad.angular_velocity_rad_s[n % 3] = std::nan("");
        break;
      case 3:
        bad.specific_force_m_s2[n % 3] = std::numeric_limits<double>::infinity();
        break;
      case 5:
        bad.stamp = bad.stamp - Span{5'000'000};  // the last one again, with other contents
        break;
      case 7:
        bad.stamp = bad.stamp - Span{42'000'000};
        break;
      case 8:
        bad.stamp = bad.stamp + Span{1'000'000};
        bad.specific_force_m_s2[n % 3] = -1e6;
        break;
      case 9:
        bad.stamp = bad.stamp + Span{100'000'000'000};
        break;
      default:
        return;
    }
    if (n > 10 && !spoilt.estimator().add_imu(bad)) ++refused;
  };
  // WHEN both fly
  clean.run_to(4);
  spoilt.run_to(4);
  // THEN every bad sample is counted, and the estimates are the same to the last bit
  EXPECT_GT(refused, 300u);
  const EstimatorStats& s = spoilt.stats();
  EXPECT_EQ(s.imu_not_finite + s.imu_duplicate + s.imu_out_of_order + s.imu_impossible + s.imu_far_ahead, refused);
  const double sixth = static_cast<double>(refused) / 6;
  EXPECT_NEAR(static_cast<double>(s.imu_not_finite), 2 * sixth, 2);
  EXPECT_NEAR(static_cast<double>(s.imu_duplicate), sixth, 2);
  EXPECT_NEAR(static_cast<double>(s.imu_impossible), sixth, 2);
  EXPECT_NEAR(static_cast<double>(s.imu_far_ahead), sixth, 2);
  EXPECT_EQ(s.imu_samples, clean.stats().imu_samples + refused);
  EXPECT_EQ(s.imu_gaps, 0u);
  ASSERT_TRUE(clean.last().has_pose);
  EXPECT_EQ(spoilt.odometry().p_WB_m, clean.odometry().p_WB_m);
  EXPECT_EQ(spoilt.odometry().q_WB, clean.odometry().q_WB);
  EXPECT_EQ(spoilt.odometry().covariance, clean.odometry().covariance);
}

TEST(EstimatorFrames, OutOfOrderAreRefused) {
  Rig rig({}, {});
  rig.run_to(2);
  if (rig.last().solved) rig.run_to(2.05);
  ASSERT_TRUE(rig.last().has_pose && !rig.last().solved);  // a frame that was only predicted counts as well
  const double now = rig.now();
  const Odometry before = rig.odometry();
  Supervisor supervisor;
  std::uint64_t refused = rig.stats().frames_refused;
  for (const double t : {now, now - 0.01, 1.5, -50.0}) {  // the same again, since the last solved one or not, long ago
    const StepResult r = rig.estimator().process(rig.image(t), supervisor);
    EXPECT_FALSE(r.has_pose) << t;
    EXPECT_EQ(rig.stats().frames_refused, ++refused) << t;
    EXPECT_EQ(rig.odometry().stamp, before.stamp) << t;
  }
  EXPECT_EQ(rig.stats().resets, 0u);
  rig.run_to(3);
  EXPECT_TRUE(rig.last().has_pose);
}

/// Position and heading in the truth's world, when the world was the same at `then`.
struct Displaced {
  Vec3 p;
  double yaw_deg;
};
Displaced error_since(const Rig& rig, const Flight& flight, double then, const Vec3& p_then, const Mat3& R_then) {
  // the truth moved into the estimator's world at `then`, by heading and position
  const auto yaw = [](const Mat3& R) { return std::atan2(R(1, 0), R(0, 0)); };
  const Mat3 turn = so3_exp(Vec3(0, 0, yaw(R_then) - yaw(flight.R(then))));
  const Vec3 p = p_then + turn * (flight.p(rig.now()) - flight.p(then));
  const double heading = yaw(R_then) - yaw(flight.R(then)) + yaw(flight.R(rig.now()));
  return {rig.p() - p, std::remainder(yaw(rig.R()) - heading, 2 * M_PI) * 180 / M_PI};
}

/// However long the camera is silent, and also when the readings of that time no longer fit the memory: the IMU carries
/// position, heading and velocity on, and the window that begins after it claims what that is worth.
TEST(EstimatorSilence, TheImuCarriesTheStateToTheNextImage) {
  for (const double silence : {1.0, 3.0, 6.0, 12.0}) {
    const Flight flight{.moving_from = 2};
    Rig rig(flight, {});
    rig.run_to(7);
    ASSERT_TRUE(rig.last().has_pose);
    const Vec3 p_then = rig.p();
    const Mat3 R_then = rig.R();
    rig.camera = false;
    rig.run_to(7 + silence);
    rig.camera = true;
    rig.run_to(7 + silence + 0.05);
    ASSERT_TRUE(rig.last().has_pose) << silence << " s";
    const Displaced e = error_since(rig, flight, 7, p_then, R_then);
    EXPECT_LT(e.p.norm(), 3.5 * rig.sigma_position() + 0.02) << silence << " s";
    EXPECT_LT(e.p.norm(), 0.06 * silence * silence) << silence << " s";
    EXPECT_LT(std::abs(e.yaw_deg), 0.3 * silence) << silence << " s";
    EXPECT_GT(rig.sigma_position(), 0.004 * silence) << "claims what it cannot know after " << silence << " s";
    EXPECT_EQ(rig.odometry().reset_counter, 0u);
    EXPECT_EQ(rig.stats().resets, 0u);
    rig.run_to(7 + silence + 5);
    EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking) << silence << " s";
    EXPECT_LT(rig.velocity_error(), 0.1);
    EXPECT_LT(rig.gyroscope_bias_error(), 5e-3);
  }
}

/// Without readings nothing carries it: the new start is where the old one ended as far as anybody can tell, and says
/// how little that is.
TEST(EstimatorReset, AfterASilentImuTheNewStartClaimsNoMoreThanItKnows) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(7);
  const Vec3 p_then = rig.p();
  const Mat3 R_then = rig.R();
  rig.imu = false;
  rig.run_to(9);
  rig.imu = true;
  double restarted = -1;
  Displaced e{};
  double sigma = 0;
  rig.run_to(16, [&] {
    if (restarted > 0 || rig.odometry().reset_counter == 0 || !rig.last().has_pose) return;
    restarted = rig.now();
    e = error_since(rig, flight, 7, p_then, R_then);
    sigma = rig.sigma_position();
  });
  ASSERT_GT(restarted, 0);
  EXPECT_LT(restarted, 13);
  EXPECT_EQ(rig.odometry().reset_counter, 1u);
  EXPECT_GT(sigma, 1) << "two seconds without readings";
  EXPECT_LT(e.p.norm(), 3 * sigma);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking) << rig.odometry().health.reasons;
}

/// One frame stamped far in the future costs itself only.
TEST(EstimatorDoor, AFrameStampedFarAheadCostsItselfOnly) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(5);
  ASSERT_TRUE(rig.last().has_pose);
  const std::uint64_t refused = rig.stats().frames_refused;
  TrackedFrame ahead = rig.image(5);
  ahead.stamp = ahead.stamp + Span::from_seconds(100);
  Supervisor supervisor;
  EXPECT_FALSE(rig.estimator().process(ahead, supervisor).has_pose);
  EXPECT_EQ(rig.stats().frames_refused, refused + 1);
  int poses = 0;
  rig.run_to(7, [&] { poses += rig.last().has_pose; });
  EXPECT_EQ(poses, 40);
  EXPECT_EQ(rig.stats().resets, 0u);
}

/// One bad number in one feature of every image, for ten seconds: left out, and nothing else changes.
TEST(EstimatorDoor, ImpossibleFeaturesAreLeftOutAndCounted) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {}), clean(flight, {});
  rig.spoil = [](TrackedFrame& frame) {
    if (frame.features.size() > 2) {
      frame.features[0].bearing[0] = std::numeric_limits<double>::quiet_NaN();
      frame.features[1].pixel_jacobian[2] = std::numeric_limits<double>::infinity();
    }
  };
  rig.run_to(12);
  clean.run_to(12);
  EXPECT_GT(rig.stats().features_refused, 100u);
  EXPECT_EQ(clean.stats().features_refused, 0u);
  EXPECT_EQ(rig.stats().resets, 0u);
  EXPECT_EQ(rig.stats().solver_failures, 0u);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT((rig.p() - clean.p()).norm(), 0.1);
  EXPECT_LT(rig.velocity_error(), 0.05);
}

class Late final : public Supervisor {
 public:
  bool time_is_up() noexcept override { return true; }
  void phase(Phase p) noexcept override { ++seen[static_cast<int>(p)]; }
  int seen[3] = {};
};

TEST(EstimatorDeadline, IsCountedSaidAndSurvived) {
  // GIVEN an estimator that wants two steps a frame and is always late, so that it takes one
  Late late;
  EstimatorConfig config;
  config.steps = 2;
  Rig rig({.moving_from = 2}, config);
  rig.supervisor = &late;
  // WHEN it flies
  rig.run_to(6);
  // THEN the misses are counted and said, and one step a frame is enough to fly on
  EXPECT_GT(rig.stats().deadline_hits, 20u);
  EXPECT_LE(rig.stats().deadline_hits, rig.stats().frames_solved);
  EXPECT_TRUE(rig.has(HealthReason::kDeadlineMissed));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_LT(rig.velocity_error(), 0.1);
  EXPECT_GT(late.seen[static_cast<int>(Supervisor::Phase::kSolve)], 20);
  EXPECT_GT(late.seen[static_cast<int>(Supervisor::Phase::kMarginalise)], 5);
}

/// Gives every frame the same effort.
class Frugal final : public Supervisor {
 public:
  Effort effort() noexcept override { return given; }
  Effort given;
};

struct Frugality {
  const char* name;
  VisualFactor factor;
  Supervisor::Effort effort;
};
void PrintTo(const Frugality& f, std::ostream* out) { *out << f.name; }

class EstimatorEffort : public testing::TestWithParam<Frugality> {};

TEST_P(EstimatorEffort, LittleOfItIsSaidAndSufficesAndIsTakenBack) {
  // GIVEN an estimator that flies with all it has, then with fewer tracks or one untried step
  Frugal frugal;
  EstimatorConfig config;
  config.visual_factor = GetParam().factor;
  Rig rig({.moving_from = 2}, config);
  rig.supervisor = &frugal;
  rig.run_to(5);
  ASSERT_EQ(rig.odometry().health.state, HealthState::kTracking);
  const EstimatorStats before = rig.stats();
  Rig full({.moving_from = 2}, config);
  full.run_to(8);
  frugal.given = GetParam().effort;
  rig.run_to(8);
  // THEN that is what it spends, it says so, it is less certain than with all it has, and its state is as good as it
  // says
  const double solves = static_cast<double>(rig.stats().solves - before.solves);
  ASSERT_GT(solves, 20);
  if (frugal.given.most_tracks > 0) {
    EXPECT_EQ(static_cast<double>(rig.stats().tracks_used - before.tracks_used), frugal.given.most_tracks * solves);
    EXPECT_GT(rig.stats().tracks_offered - before.tracks_offered, 2 * (rig.stats().tracks_used - before.tracks_used));
    EXPECT_GT(rig.sigma_velocity(), full.sigma_velocity());
  }
  if (frugal.given.most_steps == 1) {
    EXPECT_EQ(static_cast<double>(rig.stats().linearisations - before.linearisations), solves);
  }
  EXPECT_TRUE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_LT(rig.velocity_error(), 0.1);
  EXPECT_EQ(rig.stats().resets, 0u);
  // AND with full effort it says so no more
  frugal.given = {};
  rig.run_to(9);
  EXPECT_FALSE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
}

INSTANTIATE_TEST_SUITE_P(All, EstimatorEffort,
                         testing::Values(Frugality{"tracks", VisualFactor::kTrack, {true, 60, 0}},
                                         Frugality{"one_step", VisualFactor::kTrack, {true, 0, 1}},
                                         Frugality{"both", VisualFactor::kTrack, {true, 60, 1}},
                                         Frugality{"reprojection", VisualFactor::kReprojection, {true, 60, 0}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(EstimatorWithoutTime, PredictionAloneGrowsItsCovarianceAndSaysSo) {
  // GIVEN an estimator that may not solve for a second
  Frugal frugal;
  Rig rig({.moving_from = 2}, EstimatorConfig{});
  rig.supervisor = &frugal;
  rig.run_to(5);
  const std::uint64_t solved = rig.stats().frames_solved;
  frugal.given.solve = false;
  double sigma = rig.sigma_position();
  // THEN every frame has a pose whose uncertainty is larger than that of the one before, and it lies within it
  rig.run_to(6, [&] {
    EXPECT_TRUE(rig.last().has_pose);
    EXPECT_FALSE(rig.last().solved);
    EXPECT_GT(rig.sigma_position(), sigma);
    sigma = rig.sigma_position();
  });
  EXPECT_EQ(rig.stats().frames_solved, solved);
  EXPECT_GE(rig.stats().frames_predicted_for_time, 19u);
  EXPECT_TRUE(rig.has(HealthReason::kOverloaded));
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_LT(rig.velocity_error(), 4 * rig.sigma_velocity());
  // AND flies on when it may solve again
  frugal.given = {};
  rig.run_to(7);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_EQ(rig.stats().resets, 0u);
  const EstimatorStats& s = rig.stats();
  EXPECT_EQ(s.frames, s.frames_solved + s.frames_predicted + s.frames_without_pose + s.frames_refused);
}

TEST(EstimatorMemory, NeverAsksForMoreAfterConstruction) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  for (const VisualFactor factor : {VisualFactor::kTrack, VisualFactor::kEpipolar, VisualFactor::kReprojection})
    for (const double moving_from : {-2.0, 1.5}) {
      EstimatorConfig config;
      config.visual_factor = factor;
      config.estimate_extrinsics = true;
      Rig rig({.moving_from = moving_from}, config);
      const HeapCallScope scope;
      rig.run_to(4);
      rig.features = false;
      rig.run_to(5);
      rig.features = true;
      rig.camera = false;
      rig.run_to(11);
      rig.camera = true;
      rig.run_to(13);
      EXPECT_EQ(scope.calls(), 0u);
      EXPECT_GT(rig.stats().frames_solved, 10u);
    }
}

}  // namespace
}  // namespace epiline
