// An hour of flight with stamps of 2026, and flights far from the world's origin.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/estimator/rig.h"

namespace epiline {
namespace {

using test::Flight;

/// A path that comes back to where it was every 62.8 s, so that its readings and bearings need to be made up once only.
class Loop {
 public:
  static constexpr int kImages = 157, kReadings = 40;  // a loop; an interval of images
  static constexpr double kPeriod = 20 * M_PI, kInterval = kPeriod / kImages, kDt = kInterval / kReadings;

  explicit Loop(const Calibration& c) {
    const Flight flight{.moving_from = 0.5};  // from then on the path as it is
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> u(-1, 1);
    std::vector<Vec3> points;
    while (points.size() < 450) {
      const Vec3 d(u(random), u(random), u(random));
      if (d.norm() < 1 && d.norm() > 0.1) points.push_back(d.normalized() * (5 + 2.5 * u(random)));
    }
    for (int i = 0; i < kImages; ++i) {
      const double t = kBegin + i * kInterval;
      truth.push_back({flight.p(t), flight.v(t), flight.R(t)});
      for (std::size_t n = 0; n < points.size(); ++n) {
        const Vec3 X = c.R_BC.transpose() * (truth.back().R.transpose() * (points[n] - truth.back().p) - c.p_BC);
        if (X.z() < 0.5 || std::abs(X.x()) > 0.8 * X.z() || std::abs(X.y()) > 0.6 * X.z()) continue;
        images[static_cast<std::size_t>(i)].push_back({static_cast<std::uint32_t>(n), X});
      }
    }
    for (int i = 0; i < kImages * kReadings; ++i)
      readings.push_back({flight.rate(kBegin + i * kDt), flight.force(kBegin + i * kDt)});
  }
  struct State {
    Vec3 p, v;
    Mat3 R;
  };
  struct Seen {
    std::uint32_t id;
    Vec3 X;
  };
  static constexpr double kBegin = 2;
  std::vector<State> truth;
  std::array<std::vector<Seen>, kImages> images;
  std::vector<std::pair<Vec3, Vec3>> readings;  // rate, force
};

struct LongFlight {
  explicit LongFlight(const Vec3& origin, HostStamp start, double pixel_noise = 0.3)
      : calibration(synthetic_calibration()), loop(calibration), begin(start), noise_px(pixel_noise) {
    EstimatorConfig config;
    config.extrinsics.R_BC = calibration.R_BC;
    config.extrinsics.p_BC = calibration.p_BC;
    config.extrinsics.focal_px = kFocal;
    config.keyframes = 5;
    estimator = std::make_unique<Estimator>(config);
    start_at.p_WB = origin + loop.truth[0].p;
    start_at.v_WB = loop.truth[0].v;
    start_at.R_WB = loop.truth[0].R;
    start_at.b_g = b_g;
    start_at.sigma_v = 0.01;
    start_at.sigma_tilt = 0.002;
  }
  /// One more image. It is kInterval after the last one.
  StepResult next() {
    for (; reading <= image * Loop::kReadings + 2; ++reading) push_reading();
    const HostStamp stamp = begin + Span::from_seconds(image * Loop::kInterval);
    frame.stamp = stamp;
    frame.features.clear();
    for (const Loop::Seen& seen : loop.images[static_cast<std::size_t>(image % Loop::kImages)]) {
      if (frame.features.size() == 30) break;
      frame.features.push_back(make_feature(seen.id, seen.X, noise_px * Vec2(normal(random), normal(random))));
    }
    if (image++ == 0) {
      estimator->start(frame, start_at);
      return {true, true};
    }
    return estimator->process(frame, supervisor);
  }
  void push_reading() {
    const ImuNoise n;
    const auto& [rate, force] = loop.readings[static_cast<std::size_t>(reading) % loop.readings.size()];
    const double root = std::sqrt(Loop::kDt);
    const auto draw = [&](double sigma) { return Vec3(sigma * Vec3(normal(random), normal(random), normal(random))); };
    ImuSample s;
    s.stamp = begin + Span::from_seconds(reading * Loop::kDt);
    Eigen::Map<Vec3>(s.angular_velocity_rad_s.data()) = rate + b_g + draw(n.gyroscope_density / root);
    Eigen::Map<Vec3>(s.specific_force_m_s2.data()) = force + draw(n.accelerometer_density / root);
    estimator->add_imu(s);
  }
  const Loop::State& truth() const { return loop.truth[static_cast<std::size_t>((image - 1) % Loop::kImages)]; }
  const Odometry& odometry() const { return estimator->odometry(); }
  Vec3 p() const { return Vec3(odometry().p_WB_m.data()); }
  StateCovariance P() const { return Eigen::Map<const StateCovariance>(odometry().covariance.data()); }
  double seconds() const { return (image - 1) * Loop::kInterval; }

  Calibration calibration;
  Loop loop;
  HostStamp begin;
  double noise_px;
  Vec3 b_g = Vec3(0.02, -0.015, 0.03);
  InitialState start_at;
  std::unique_ptr<Estimator> estimator;
  Supervisor supervisor;
  TrackedFrame frame;
  std::mt19937_64 random{11};
  std::normal_distribution<double> normal;
  int image = 0, reading = 0;
};

constexpr HostStamp kNovember2026{1'795'000'000'123'456'789};

/// Unknowns of different units made comparable: the correlations.
double least_correlation_eigenvalue(const StateCovariance& P) {
  const Eigen::Matrix<double, 16, 1> unit = P.diagonal().cwiseSqrt().cwiseInverse();
  return test::least_eigenvalue(unit.asDiagonal() * P * unit.asDiagonal());
}

TEST(EstimatorEndurance, AnHourIsFlownWithoutAResetAndTheCovarianceGrowsAsARandomWalk) {
  LongFlight flight(Vec3::Zero(), kNovember2026);
  double quarter = 0, last = 0, worst = 0;
  int judged = 0, tracking = 0, lost = 0;
  while (flight.seconds() < 3600) {
    const StepResult r = flight.next();
    ASSERT_TRUE(r.has_pose && r.solved) << flight.seconds();
    ASSERT_EQ(flight.odometry().stamp, kNovember2026 + Span::from_seconds(flight.seconds()));
    const StateCovariance P = flight.P();
    ASSERT_TRUE(P.allFinite() && flight.p().allFinite()) << flight.seconds();
    if (flight.image % 20 != 0) continue;
    EXPECT_EQ((P - P.transpose()).cwiseAbs().maxCoeff(), 0);
    EXPECT_GT(least_correlation_eigenvalue(P), 0) << flight.seconds();
    ++judged;
    tracking += flight.odometry().health.state == HealthState::kTracking;
    lost += flight.odometry().health.state == HealthState::kLost;
    last = std::sqrt(P.topLeftCorner<2, 2>().trace());
    if (flight.seconds() < 900) quarter = last;
    worst = std::max(worst, (flight.p() - flight.truth().p).norm() / std::sqrt(P.topLeftCorner<3, 3>().trace()));
  }
  EXPECT_GT(tracking, 0.9 * judged);  // some images show fewer than 20 points
  EXPECT_EQ(lost, 0);
  EXPECT_LT(worst, 4);
  EXPECT_GT(last / quarter, 1.5) << "of four times the way, twice the deviation";
  EXPECT_LT(last / quarter, 3);
  EXPECT_EQ(flight.estimator->stats().resets, 0u);
  EXPECT_EQ(flight.estimator->stats().solver_failures, 0u);
  EXPECT_EQ(flight.estimator->stats().imu_gaps, 0u);
  EXPECT_EQ(flight.estimator->stats().frames_refused, 0u);
  EXPECT_NEAR(flight.odometry().time_offset_s, 0, 2e-3);
}

/// The world's origin is 10 km away: nothing that is measured changes, so that nothing but rounding may.
TEST(EstimatorFarAway, FliesAsItDoesAtTheOrigin) {
  for (const Vec3& away : {Vec3(10e3, 0, 0), Vec3(-6e3, 8e3, 0), Vec3(0, 0, 10e3)}) {
    LongFlight here(Vec3::Zero(), kNovember2026), there(away, kNovember2026);
    double position = 0, covariance = 0, velocity = 0;
    for (int i = 0; i < 300; ++i) {
      here.next();
      there.next();
      position = std::max(position, (there.p() - away - here.p()).norm());
      velocity =
          std::max(velocity, (Vec3(there.odometry().v_WB_m_s.data()) - Vec3(here.odometry().v_WB_m_s.data())).norm());
      const StateCovariance a = here.P(), b = there.P();
      for (int k = 0; k < 16; ++k) covariance = std::max(covariance, std::abs(b(k, k) / a(k, k) - 1));
    }
    EXPECT_LT(position, 1e-9);  // 3e-11 is reached
    EXPECT_LT(velocity, 1e-9);
    EXPECT_LT(covariance, 1e-7);
    EXPECT_EQ(there.estimator->stats().resets, 0u);
  }
}

}  // namespace
}  // namespace epiline
