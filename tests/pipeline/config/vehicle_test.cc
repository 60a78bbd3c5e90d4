#include "pipeline/config/vehicle.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(Vehicle, TheBodysTurnsAreThoseOfItsAxes) {
  EXPECT_TRUE(R_VB_of({}).isIdentity());
  // turned by 90 degrees to the left: the IMU's x points left, its y backwards
  const Mat3 yawed = R_VB_of({{90, 0, 0}});
  EXPECT_TRUE((yawed * Vec3::UnitX()).isApprox(Vec3::UnitY()));
  EXPECT_TRUE((yawed * Vec3::UnitY()).isApprox(-Vec3::UnitX()));
  // upside down, x forward: y points right, z down
  const Mat3 rolled = R_VB_of({{0, 0, 180}});
  EXPECT_TRUE((rolled * Vec3::UnitY()).isApprox(-Vec3::UnitY()));
  EXPECT_TRUE((rolled * Vec3::UnitZ()).isApprox(-Vec3::UnitZ()));
  // nose down, that is about the left axis: x points down
  EXPECT_TRUE((R_VB_of({{0, 90, 0}}) * Vec3::UnitX()).isApprox(-Vec3::UnitZ()));
  // yaw first, then pitch about the axis that has been turned: x points down whatever the yaw
  EXPECT_TRUE((R_VB_of({{30, 90, 0}}) * Vec3::UnitX()).isApprox(-Vec3::UnitZ()));
}

TEST(Vehicle, ThePointOfTheWheelsIsSeenFromTheImu) {
  Config config;
  config.devices.wheel.position_m = {1, 0.5, -0.25};
  // the IMU's x points left, its y backwards: what is 1 m ahead is at y = -1 m
  config.devices.body.yaw_pitch_roll_deg = {90, 0, 0};
  set_vehicle(config);
  const WheelModel& wheel = config.estimator.wheel;
  EXPECT_TRUE(wheel.forward_B.isApprox(-Vec3::UnitY()));
  EXPECT_TRUE(wheel.p_BV.isApprox(Vec3(0.5, -1, -0.25)));
}

TEST(Vehicle, TheRangeFinderLooksDownUnlessTold) {
  Config config;
  const HeightModel& range = config.estimator.heights[1];
  set_vehicle(config);
  EXPECT_TRUE(range.beam_B.isApprox(-Vec3::UnitZ()));
  // an IMU that lies upside down, x forward: y points right, z down
  config.devices.body.yaw_pitch_roll_deg = {0, 0, 180};
  HeightConfig& height = config.devices.height;
  height.range_position_m = {0.1, 0.2, -0.3};
  height.range_tilt_deg = {45, 0};
  set_vehicle(config);
  EXPECT_TRUE(range.p_BS.isApprox(Vec3(0.1, -0.2, 0.3)));
  EXPECT_TRUE(range.beam_B.isApprox(Vec3(1, 0, 1).normalized())) << range.beam_B.transpose();
}

}  // namespace
}  // namespace epiline
