// An hour of flight with stamps of 2026, and flights far from the world's origin.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/estimator/dense_algebra.h"
#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

constexpr HostStamp kNovember2026{1'795'000'000'123'456'789};

/// Few images, tracks and keyframes, for an hour within seconds. It starts from the truth, moved to another origin.
struct LongFlight {
  static EstimatorConfig few_keyframes() {
    EstimatorConfig config;
    config.keyframes = 5;
    return config;
  }
  explicit LongFlight(const Vec3& origin) {
    rig.begin = kNovember2026;
    rig.image_period_s = 0.4;
    rig.imu_period_s = 0.01;
    rig.imu_delay_s = -0.02;
    rig.most_features = 30;
    InitialState x;
    x.p_WB = origin + path.p(0);
    x.v_WB = path.v(0);
    x.R_WB = path.R(0);
    x.b_g = path.b_g;
    x.b_a = path.b_a;
    x.sigma_v = 0.01;
    x.sigma_tilt = 0.002;
    rig.start(x);
  }
  StateCovariance P() const { return Eigen::Map<const StateCovariance>(rig.odometry().covariance.data()); }

  const Flight path{.moving_from = -1.5};
  Rig rig{path, few_keyframes(), 450};
};

/// Unknowns of different units made comparable: the correlations.
double least_correlation_eigenvalue(const StateCovariance& P) {
  return least_eigenvalue(in_units(P, P.diagonal().cwiseSqrt()));
}

TEST(EstimatorEndurance, AnHourIsFlownWithoutAResetAndTheCovarianceGrowsAsARandomWalk) {
  LongFlight flight(Vec3::Zero());
  Rig& rig = flight.rig;
  double quarter = 0, last = 0, worst = 0;
  int judged = 0, tracking = 0, lost = 0;
  rig.run_to(3600, [&] {
    ASSERT_TRUE(rig.last().has_pose && rig.last().solved) << rig.now();
    ASSERT_EQ(rig.odometry().stamp, kNovember2026 + Span::from_seconds(rig.now()));
    const StateCovariance P = flight.P();
    ASSERT_TRUE(P.allFinite() && rig.p().allFinite()) << rig.now();
    if (judged++ % 20 != 0) return;
    EXPECT_EQ(relative_difference(P.transpose(), P), 0);
    EXPECT_GT(least_correlation_eigenvalue(P), 0) << rig.now();
    tracking += rig.odometry().health.state == HealthState::kTracking ? 20 : 0;
    lost += rig.odometry().health.state == HealthState::kLost;
    last = std::hypot(rig.sigma(0), rig.sigma(1));
    if (rig.now() < 900) quarter = last;
    worst = std::max(worst, (rig.p() - flight.path.p(rig.now())).norm() / std::hypot(last, rig.sigma(2)));
  });
  EXPECT_GT(tracking, 0.9 * judged);  // some images show fewer than 20 points
  EXPECT_EQ(lost, 0);
  EXPECT_LT(worst, 4);
  EXPECT_GT(last / quarter, 1.5) << "of four times the way, twice the deviation";
  EXPECT_LT(last / quarter, 3);
  EXPECT_EQ(rig.stats().resets, 0u);
  EXPECT_EQ(rig.stats().solver_failures, 0u);
  EXPECT_EQ(rig.stats().imu_gaps, 0u);
  EXPECT_EQ(rig.stats().frames_refused, 0u);
  EXPECT_NEAR(rig.odometry().time_offset_s, 0, 2e-3);
}

/// The world's origin is 10 km away: nothing that is measured changes, so that nothing but rounding may.
TEST(EstimatorFarAway, FliesAsItDoesAtTheOrigin) {
  for (const Vec3& away : {Vec3(10e3, 0, 0), Vec3(-6e3, 8e3, 0), Vec3(0, 0, 10e3)}) {
    LongFlight here(Vec3::Zero()), there(away);
    double position = 0, covariance = 0, velocity = 0;
    there.rig.run_to(120, [&] {
      here.rig.run_to(there.rig.now());
      position = std::max(position, (there.rig.p() - away - here.rig.p()).norm());
      velocity = std::max(velocity, (there.rig.v() - here.rig.v()).norm());
      for (int k = 0; k < 16; ++k)
        covariance = std::max(covariance, std::abs(there.rig.sigma(k) / here.rig.sigma(k) - 1));
    });
    EXPECT_LT(position, 1e-9);  // 3e-11 is reached
    EXPECT_LT(velocity, 1e-9);
    EXPECT_LT(covariance, 1e-7);
    EXPECT_EQ(there.rig.stats().resets, 0u);
  }
}

}  // namespace
}  // namespace epiline::test
