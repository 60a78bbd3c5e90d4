// The estimator without features, without images and without readings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

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
    // THEN poses go on and the health names the silence
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

/// A slow image pipeline, or a caller that does not keep step: whatever the lead, poses are those of their images.
TEST(EstimatorSilence, ReadingsMayBeAheadOfTheImages) {
  for (const double ahead : {0.5, 0.9, 1.2, 2.0}) {
    const Flight flight{.moving_from = 2};
    Rig rig(flight, {});
    rig.imu_delay_s = -ahead;
    rig.run_to(5);
    ASSERT_TRUE(rig.last().has_pose);
    const double then = rig.now();
    const Vec3 p_then = rig.p();
    const Mat3 R_then = rig.R();
    int tracking = 0;
    rig.run_to(15, [&] {
      ASSERT_TRUE(rig.last().has_pose);
      tracking += rig.odometry().health.state == HealthState::kTracking ? 1 : 0;
      EXPECT_LT(error_since(rig, flight, then, p_then, R_then).p.norm(), 0.03) << ahead << " s, at " << rig.now();
      EXPECT_LT(rig.velocity_error(), 0.05) << ahead << " s, at " << rig.now();
    });
    EXPECT_EQ(tracking, 200) << ahead;
  }
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

/// In flight and in a replay, whose readings after the silence are there before its images are.
TEST(EstimatorSilence, ImagesCarryOnWhileTheImuIsSilent) {
  for (const double ahead : {0.01, 5.0}) {
    for (const double silence : {0.3, 0.7, 2.0, 4.0}) {
      SCOPED_TRACE(testing::Message() << silence << " s, readings ahead by " << ahead << " s");
      const Flight flight{.moving_from = 2};
      Rig rig(flight, {});
      rig.imu_delay_s = -ahead;
      rig.run_to(7);
      rig.imu = false;
      rig.run_to(7 + silence);
      rig.imu = true;
      const auto judge = [&, p_then = rig.p(), R_then = rig.R(), then = rig.now()] {
        if (!rig.last().solved) return;
        const Displaced e = error_since(rig, flight, then, p_then, R_then);
        EXPECT_LT(e.p.norm(), 0.02 + 0.02 * silence) << rig.now();
        EXPECT_LT(std::abs(e.yaw_deg), 0.5) << rig.now();
      };
      rig.run_to(7 + ahead + silence + 5, judge);
      EXPECT_EQ(rig.stats().resets, 0u);
      EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
      EXPECT_LT(rig.velocity_error(), 0.05);
    }
  }
}

/// And say so: nobody measures speed and scale meanwhile.
TEST(EstimatorSilence, OfTheImuIsNamedUntilTheReadingsHaveTakenOver) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(7);
  rig.imu = false;
  int poses = 0;
  const auto expect_named = [&] {
    poses += rig.last().has_pose ? 1 : 0;
    EXPECT_TRUE(rig.has(HealthReason::kImuSilent) || rig.has(HealthReason::kImuGap)) << rig.now();
    EXPECT_NE(rig.odometry().health.state, HealthState::kTracking) << rig.now();
  };
  rig.run_to(9, expect_named);
  EXPECT_GE(poses, 15);
  rig.imu = true;
  rig.run_to(9.9, expect_named);
  rig.run_to(11);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
}

/// One that stood has not seen how far anything is: the images of its take-off have no scale.
TEST(EstimatorSilence, OfATakeOffImagesTellNoScale) {
  const Flight flight{.moving_from = 5};
  Rig rig(flight, {});
  rig.run_to(4);
  ASSERT_EQ(rig.odometry().health.state, HealthState::kTracking);
  rig.imu = false;
  rig.run_to(6.5);
  EXPECT_FALSE(rig.last().has_pose);
  rig.imu = true;
  rig.run_to(11);
  EXPECT_EQ(rig.stats().resets, 1u);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT(rig.velocity_error(), 0.1);
}

/// Without readings and images nothing carries it: the new start is where the old one ended as far as anybody can tell,
/// and says how little that is.
TEST(EstimatorReset, AfterASilentImuTheNewStartClaimsNoMoreThanItKnows) {
  const Flight flight{.moving_from = 2};
  Rig rig(flight, {});
  rig.run_to(7);
  const Vec3 p_then = rig.p();
  const Mat3 R_then = rig.R();
  rig.imu = rig.camera = false;
  rig.run_to(9);
  rig.imu = rig.camera = true;
  rig.spoil = [](TrackedFrame& frame) { rename_tracks(1, frame); };
  double restarted = -1;
  Displaced e{};
  double sigma = 0, sigma_yaw = 0, worst_offset_s = 0;
  rig.run_to(16, [&] {
    if (rig.odometry().reset_counter == 0 || !rig.last().has_pose) return;
    worst_offset_s = std::max(worst_offset_s, std::abs(rig.odometry().time_offset_s));
    if (restarted > 0) return;
    restarted = rig.now();
    e = error_since(rig, flight, 7, p_then, R_then);
    sigma = rig.sigma_position();
    sigma_yaw = rig.sigma_yaw();
  });
  ASSERT_GT(restarted, 0);
  EXPECT_LT(restarted, 13);
  EXPECT_EQ(rig.odometry().reset_counter, 1u);
  EXPECT_GT(sigma, 1) << "two seconds without readings";
  EXPECT_LT(e.p.norm(), 3 * sigma);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking) << rig.odometry().health.reasons;
  // AND nothing that it sees afterwards tells where north is: the world stays as it was put, and as little known
  EXPECT_GT(sigma_yaw, 0.5) << "two seconds without readings";
  EXPECT_GT(rig.sigma_yaw(), 0.99 * sigma_yaw);
  EXPECT_LT(std::abs(error_since(rig, flight, 7, p_then, R_then).yaw_deg - e.yaw_deg), 1.5);
  EXPECT_LT(worst_offset_s, 5e-3) << "the camera is on time";
}

}  // namespace
}  // namespace epiline::test
