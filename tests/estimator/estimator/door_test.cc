// What the estimator does not let in: corrupt readings, frames out of order or far ahead, impossible features and
// heights.
#include <gtest/gtest.h>

#include <limits>

#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

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

// A caller may let the window slide when the odometry has left; one that does not gets the same odometry.
TEST(EstimatorFrames, WhetherTheCallerSlidesChangesNothing) {
  const Flight flight{.moving_from = 2};
  Rig slides(flight, {}), does_not(flight, {});
  Supervisor supervisor;
  int keyframes = 0;
  slides.run_to(6, [&] {
    const Odometry before = slides.odometry();
    keyframes += slides.estimator().slide(supervisor);
    EXPECT_FALSE(slides.estimator().slide(supervisor)) << "once for each frame";
    EXPECT_EQ(slides.odometry().covariance, before.covariance);
  });
  does_not.run_to(6);
  ASSERT_TRUE(slides.last().has_pose);
  EXPECT_GT(keyframes, 3);
  EXPECT_EQ(static_cast<std::uint64_t>(keyframes), slides.stats().keyframes);
  EXPECT_EQ(slides.odometry().p_WB_m, does_not.odometry().p_WB_m);
  EXPECT_EQ(slides.odometry().q_WB, does_not.odometry().q_WB);
  EXPECT_EQ(slides.odometry().covariance, does_not.odometry().covariance);
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

/// Readings that come 0.2 s late while the estimator is still starting: the frames that are ahead of them are left out,
/// not joined by a guess that nothing would ever correct, and those gathered before are kept.
TEST(EstimatorDoor, AStartLeavesOutFramesAheadOfTheReadings) {
  const Flight flight{.moving_from = -1};
  Rig rig(flight, {});
  rig.run_to(0.3);
  ASSERT_FALSE(rig.stats().solves > 0);
  const double readings_come_in_time = rig.imu_delay_s;
  rig.imu_delay_s = 0.2;
  rig.run_to(0.45);
  EXPECT_EQ(rig.stats().frames_refused, 3u);
  rig.imu_delay_s = readings_come_in_time;
  double first_pose = 0, velocity_error = 0;
  rig.run_to(2, [&] {
    if (first_pose > 0 || !rig.last().has_pose) return;
    first_pose = rig.now();
    velocity_error = rig.velocity_error();
  });
  EXPECT_EQ(rig.stats().frames_refused, 3u);
  EXPECT_GT(first_pose, 0.45);
  EXPECT_LT(first_pose, 1);
  EXPECT_LT(velocity_error, 0.15);
  EXPECT_LT(rig.velocity_error(), 0.05);
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
  rig.run_to(1);
  clean.run_to(1);
  EXPECT_TRUE(rig.last().has_pose) << "both start at rest";
  EXPECT_TRUE(clean.last().has_pose);
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

/// A camera that gives each fifth image once more, under a stamp of its own, while the vehicle turns: it has taken
/// none.
TEST(EstimatorDoor, ACopyOfAnImageIsNotSolved) {
  Rig rig({.moving_from = 1}, {});
  TrackedFrame before;
  int n = 0, solved = 0, poses = 0;
  rig.spoil = [&](TrackedFrame& frame) {
    if (++n % 5 == 0) frame.features.copy(before.features);
    before.features.copy(frame.features);
  };
  rig.run_to(2);
  rig.run_to(8, [&] {
    poses += rig.last().has_pose;
    solved += n % 5 == 0 && rig.last().solved;
  });
  EXPECT_EQ(solved, 0);
  EXPECT_EQ(poses, 120);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_LT(rig.velocity_error(), 0.03);
}

/// A scene without noise looks the same again and again.
TEST(EstimatorDoor, AStandingVehicleWithoutNoiseIsNoRowOfCopies) {
  Rig rig({}, {});
  rig.pixel_noise = 0;
  rig.run_to(4);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
  EXPECT_GT(rig.stats().frames_solved, 15U);
}

/// What is carried on over readings at the sensor's limit is worth less than what images had confirmed before.
TEST(EstimatorDoor, APoseAfterReadingsAtTheLimitIsDegraded) {
  Rig rig({.moving_from = 1}, {});
  rig.run_to(5);
  if (!rig.last().solved) rig.run_to(5.05);
  ASSERT_TRUE(rig.last().solved);
  ASSERT_EQ(rig.odometry().health.state, HealthState::kTracking);
  ImuSample hit;
  hit.stamp = at(rig.now() + 0.0125);
  hit.specific_force_m_s2 = {0, 1e3, 9.81};
  hit.reasons = bit(HealthReason::kImuSaturated);
  EXPECT_TRUE(rig.estimator().add_imu(hit));
  rig.run_to(rig.now() + 0.05);
  ASSERT_TRUE(rig.last().has_pose && !rig.last().solved);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kDegraded);
  EXPECT_TRUE(rig.has(HealthReason::kImuGap));
  rig.run_to(rig.now() + 1);
  EXPECT_EQ(rig.odometry().health.state, HealthState::kTracking);
}

/// What it makes of heights: tests/flights/height_test.cc.
HeightSample height(HeightKind kind, std::int64_t ms, double metres) {
  return {HostStamp{ms * 1'000'000}, kind, metres};
}

TEST(HeightDoor, LetsInWhatIsLaterAndWithinTheRange) {
  EstimatorConfig config;
  config.heights[1].limits_m[1] = 60;
  Estimator estimator(config);
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const HeightKind kind : {HeightKind::kBarometer, HeightKind::kRangeFinder}) {
    EXPECT_TRUE(estimator.add_height(height(kind, 100, 50)));
    EXPECT_FALSE(estimator.add_height(height(kind, 100, 51)));
    EXPECT_FALSE(estimator.add_height(height(kind, 90, 51)));
    for (const double metres : {nan, inf, -inf, 1e9}) EXPECT_FALSE(estimator.add_height(height(kind, 200, metres)));
    EXPECT_TRUE(estimator.add_height(height(kind, 200, 51)));
  }
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kRangeFinder, 300, 61)));
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kRangeFinder, 300, 0.01)));
  EXPECT_TRUE(estimator.add_height(height(HeightKind::kBarometer, 300, -20)));
  const EstimatorStats& stats = estimator.stats();
  EXPECT_EQ(stats.height_samples[0], 3u);
  EXPECT_EQ(stats.height_samples[1], 2u);
  EXPECT_EQ(stats.height_refused[0], 6u);
  EXPECT_EQ(stats.height_refused[1], 8u);
}

TEST(HeightDoor, IsClosedToASensorThatIsNotToBeUsed) {
  EstimatorConfig config;
  config.heights[0].use = false;
  Estimator estimator(config);
  EXPECT_FALSE(estimator.add_height(height(HeightKind::kBarometer, 100, 50)));
  EXPECT_TRUE(estimator.add_height(height(HeightKind::kRangeFinder, 100, 50)));
}

}  // namespace
}  // namespace epiline::test
