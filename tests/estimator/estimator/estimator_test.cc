// The estimator as a whole on made-up flights: how it starts, and that it never asks for memory.
#include "estimator/estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "platform/memory/allocation_count.h"
#include "tests/estimator/any_factor.h"
#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

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

/// Ten images show that tracks are worse than configured, however few keyframes the window keeps afterwards.
TEST(EstimatorStart, InMotionTakesTheImagesItNeedsWithFewKeyframes) {
  for (const int keyframes : {2, 5, 8}) {
    EstimatorConfig config;
    config.keyframes = keyframes;
    Rig rig({.moving_from = -2}, config);
    rig.pixel_noise = 1.2;
    double first_pose = -1;
    rig.run_to(8, [&] {
      if (first_pose < 0 && rig.last().has_pose) first_pose = rig.now();
    });
    EXPECT_GT(first_pose, 0) << keyframes;
    EXPECT_LT(first_pose, 2) << keyframes;
    EXPECT_EQ(rig.stats().resets, 0u) << keyframes;
    EXPECT_LT(rig.velocity_error(), 0.1) << keyframes;
  }
}

/// What three false matches and the IMU tie to the others is no part of a start.
TEST(EstimatorStart, BeginsAnewAtAnImageThatShowsNothingOfTheOnesBefore) {
  Rig rig({.moving_from = -2}, {});
  rig.run_to(0.05);
  rig.camera = false;
  rig.run_to(1);
  rig.camera = true;
  rig.spoil = [](TrackedFrame& frame) {
    for (std::size_t i = 3; i < frame.features.size(); ++i) frame.features[i].id += 100'000;
  };
  rig.run_to(8);
  ASSERT_TRUE(rig.last().has_pose);
  EXPECT_GE(rig.stats().origins[0].stamp, at(1));
  EXPECT_LT(rig.velocity_error(), 0.06);
}

TEST(ConfiguredNoise, IsThatOfTheAccelerometersBiasTimesItsFactor) {
  const auto flown = [](double walk, double factor) {
    EstimatorConfig config;
    config.imu.accelerometer_random_walk = walk;
    config.accelerometer_walk_factor = factor;
    Rig rig(Flight{.moving_from = -2}, config);
    rig.run_to(4, [] {});
    return rig.odometry();
  };
  const Odometry twice = flown(3e-3, 2), configured = flown(6e-3, 1), slow = flown(3e-3, 1);
  EXPECT_EQ(twice.p_WB_m, configured.p_WB_m);
  EXPECT_EQ(twice.covariance, configured.covariance);
  const int bias = 16 * 9 + 9;
  EXPECT_GT(twice.covariance[bias], slow.covariance[bias]);
}

TEST(EstimatorMemory, NeverAsksForMoreAfterConstruction) {
  if (!allocation_counting_available()) GTEST_SKIP() << "heap calls are not counted in this build";
  expect_no_heap_calls({});
}

/// The start called its place exact. What the window learns of the camera's place later, it has to take back.
TEST(EstimatorOutput, AnOriginFoundUnderAWrongCalibrationIsNoLongerCalledExact) {
  Flight flight{.moving_from = -2};
  flight.pace = 3;
  for (const double error_m : {0.0, 0.2}) {
    Rig rig(flight, {}, 900, Vec3(error_m, 0, 0));
    std::optional<double> then;
    double sigma_then = 0, worst = 0, widest = 0;
    Vec3 p_then;
    Mat3 R_then;
    rig.run_to(6.5, [&] {
      if (!rig.last().has_pose) return;
      if (!then) {
        then = rig.now();
        sigma_then = rig.sigma_position();
        p_then = rig.p();
        R_then = rig.R();
      }
      if (rig.now() < *then + 3) return;
      const double error = error_since(rig, flight, *then, p_then, R_then).p.norm();
      worst = std::max(worst, error / std::hypot(rig.sigma_position(), sigma_then));
      widest = std::max(widest, rig.sigma_position());
    });
    ASSERT_TRUE(then);
    EXPECT_LT(worst, 3.5) << error_m;
    EXPECT_EQ(widest < 0.03, error_m == 0) << "only wrong numbers are doubted: " << widest;
  }
}

/// A pose is published with the image's stamp, as a time of the IMU's clock; so is the velocity, however late or early
/// the camera's clock is.
TEST(EstimatorOutput, VelocityIsThatOfTheStamp) {
  const Flight flight{.moving_from = 1};
  for (const double offset : {-0.02, 0.02}) {
    EstimatorConfig config;
    config.estimate_time_offset = false;
    config.extrinsics.time_offset_s = offset;
    Rig rig(flight, config);
    rig.time_offset = offset;
    rig.pixel_noise = 0.05;
    double square_error = 0, square_change = 0;
    int frames = 0;
    rig.run_to(12, [&] {
      if (rig.now() < 4) return;
      const double stamp = rig.now() - offset;
      const Vec3 truth = flight.R(stamp).transpose() * flight.v(stamp);
      square_error += (rig.R().transpose() * rig.v() - truth).squaredNorm();
      square_change += (flight.v(rig.now()) - flight.v(stamp)).squaredNorm();
      ++frames;
    });
    EXPECT_LT(std::sqrt(square_error / frames), 0.006) << offset;
    EXPECT_GT(std::sqrt(square_change / frames), 0.012) << offset;  // what is at stake
  }
}

}  // namespace
}  // namespace epiline::test
