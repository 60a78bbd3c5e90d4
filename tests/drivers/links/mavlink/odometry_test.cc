// What a flight controller is told, against motions that can be said in words, and covariances against small
// disturbances of the estimate.
#include "drivers/links/mavlink/odometry.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/geometry/so3.h"
#include "tests/drivers/links/mavlink/link_peer.h"

namespace epiline::mavlink {
namespace {

using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr double kQuarter = std::numbers::pi / 2;
const Mat3 kLevel = Mat3::Identity();  // the IMU's axes are forward, left, up

Vec3 position(const Odometry& m) { return {m.x, m.y, m.z}; }
Vec3 velocity(const Odometry& m) { return {m.vx, m.vy, m.vz}; }
Vec3 rates(const Odometry& m) { return {m.rollspeed, m.pitchspeed, m.yawspeed}; }
Mat3 attitude(const Odometry& m) { return Eigen::Quaterniond(m.q[0], m.q[1], m.q[2], m.q[3]).toRotationMatrix(); }

epiline::Odometry odometry(const Vec3& p_WB, const Mat3& R_WB, const Vec3& v_WB, const Vec3& omega_B) {
  epiline::Odometry o;
  o.stamp.ns = 1'234'567'891'234;
  Eigen::Map<Vec3>(o.p_WB_m.data()) = p_WB;
  Eigen::Map<Vec3>(o.v_WB_m_s.data()) = v_WB;
  Eigen::Map<Vec3>(o.omega_B_rad_s.data()) = omega_B;
  const Eigen::Quaterniond q(R_WB);
  o.q_WB = {q.w(), q.x(), q.y(), q.z()};
  o.health = {HealthState::kTracking, 0, 80};
  return o;
}

void expect_near(const Vec3& value, const Vec3& expected) { EXPECT_LT((value - expected).norm(), 1e-6) << value; }

// One metre ahead, two to the left, three up; turning left, nose rising.
TEST(MavlinkOdometry, LeftIsNegativeAndUpIsNegative) {
  const Odometry m = odometry_message(odometry({1, 2, 3}, kLevel, {4, 5, 6}, {0.1, -0.2, 0.3}), kLevel);
  expect_near(position(m), {1, -2, -3});
  expect_near(velocity(m), {4, -5, -6});
  expect_near(rates(m), {0.1, 0.2, -0.3});
  expect_near(attitude(m) * Vec3::UnitX(), Vec3::UnitX());
  EXPECT_EQ(m.time_usec, 1'234'567'891U);
  EXPECT_EQ(m.frame_id, 20);
  EXPECT_EQ(m.child_frame_id, 12);
  EXPECT_EQ(m.estimator_type, 3);
}

// Turned to the left by a quarter, flying to where the nose points.
TEST(MavlinkOdometry, VelocityIsThatOfTheBody) {
  const Odometry m = odometry_message(odometry({0, 0, 0}, so3_exp(Vec3(0, 0, kQuarter)), {0, 2, 0}, {0, 0, 0}), kLevel);
  expect_near(velocity(m), {2, 0, 0});
  expect_near(attitude(m) * Vec3::UnitX(), -Vec3::UnitY());  // the nose points left
  expect_near(attitude(m) * Vec3::UnitY(), Vec3::UnitX());   // and the right wing ahead
}

TEST(MavlinkOdometry, RollPitchAndYawHaveTheirSigns) {
  const auto angles = [](const Vec3& turn_B) {
    const auto m = vision_position_message(odometry({1, 2, 3}, so3_exp(turn_B), {0, 0, 0}, {0, 0, 0}), kLevel);
    expect_near({m.x, m.y, m.z}, {1, -2, -3});
    return Vec3(m.roll, m.pitch, m.yaw);
  };
  expect_near(angles({0.3, 0, 0}), {0.3, 0, 0});   // right wing down
  expect_near(angles({0, -0.3, 0}), {0, 0.3, 0});  // nose up
  expect_near(angles({0, 0, -0.3}), {0, 0, 0.3});  // nose to the right
  const Mat3 R = so3_exp(Vec3(0.2, -0.4, 1));
  const auto m = vision_position_message(odometry({0, 0, 0}, R, {0, 0, 0}, {0, 0, 0}), kLevel);
  const Mat3 composed = (Eigen::AngleAxisd(m.yaw, Vec3::UnitZ()) * Eigen::AngleAxisd(m.pitch, Vec3::UnitY()) *
                         Eigen::AngleAxisd(m.roll, Vec3::UnitX()))
                            .toRotationMatrix();
  EXPECT_LT((composed - attitude(odometry_message(odometry({0, 0, 0}, R, {0, 0, 0}, {0, 0, 0}), kLevel))).norm(), 1e-6);
}

/// The IMU stands on its side: x up, y right, z ahead. Columns: its axes in forward, left, up.
Mat3 on_its_side() { return (Mat3() << 0, 0, 1, 0, -1, 0, 1, 0, 0).finished(); }

// The vehicle does what it did above.
TEST(MavlinkOdometry, TheMountOfTheImuIsTakenOut) {
  const Mat3 R_VB = on_its_side();
  const Mat3 R_WV = so3_exp(Vec3(0.2, -0.1, 0.7));
  const Vec3 v_WB(1, 2, 3), omega_V(0.4, 0.5, 0.6);
  const auto plain = odometry_message(odometry({1, 2, 3}, R_WV, v_WB, omega_V), kLevel);
  const auto turned = odometry_message(odometry({1, 2, 3}, R_WV * R_VB, v_WB, R_VB.transpose() * omega_V), R_VB);
  EXPECT_LT((attitude(turned) - attitude(plain)).norm(), 1e-6);
  expect_near(velocity(turned), velocity(plain));
  expect_near(rates(turned), rates(plain));
  expect_near(position(turned), position(plain));
}

Mat6 full(const std::array<float, 21>& triangle) {
  Mat6 C;
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) C(i, j) = C(j, i) = triangle[at++];
  return C;
}

// The nose points south-east at the start, whatever the estimator calls it. The vehicle then flies to where it points.
TEST(MavlinkOdometry, InLocalNedTheFirstHeadingIsTheGivenOne) {
  const Vec3 south_east = Vec3(-1, 1, 0).normalized();
  const Mat3 R_VB = on_its_side();
  for (const double yaw : {0.0, 0.3, -2.5}) {
    const Mat3 R_WV = so3_exp(Vec3(0, 0, yaw));
    LocalFrame frame(north(135));
    frame.see(odometry({1, 2, 0}, R_WV * R_VB, {0, 0, 0}, {0, 0, 0}), R_VB);
    const Vec3 nose = R_WV * Vec3::UnitX();
    const auto o = odometry(4 * nose + Vec3(0, 0, 3), R_WV * R_VB, 2 * nose, {0, 0, 0});
    const Odometry m = odometry_message(o, R_VB, frame);
    expect_near(position(m), 4 * south_east + Vec3(0, 0, -3));
    expect_near(attitude(m) * Vec3::UnitX(), south_east);
    expect_near(attitude(m) * Vec3::UnitZ(), Vec3::UnitZ());
    expect_near(velocity(m), {2, 0, 0});
    EXPECT_EQ(m.frame_id, 1);
    EXPECT_EQ(m.child_frame_id, 12);
    EXPECT_NEAR(vision_position_message(o, R_VB, frame).yaw, 3 * kQuarter / 2, 1e-6);
  }
}

TEST(MavlinkOdometry, TheNorthIsFoundOnce) {
  LocalFrame frame(north(90));
  const auto first = odometry({0, 0, 0}, kLevel, {0, 0, 0}, {0, 0, 0});
  frame.see(first, kLevel);
  auto later = odometry({5, 0, 0}, so3_exp(Vec3(0, 0, kQuarter)), {0, 0, 0}, {0, 0, 0});
  later.reset_counter = first.reset_counter + 1;
  frame.see(later, kLevel);
  const Odometry m = odometry_message(later, kLevel, frame);
  expect_near(position(m), {0, 5, 0});                      // east
  expect_near(attitude(m) * Vec3::UnitX(), Vec3::UnitX());  // turned to the left: north
}

TEST(MavlinkOdometry, SaysWhichFrameAndHeadingDoNotGoTogether) {
  const auto fault = [](const MavlinkConfig& config) {
    const Status status = fault_of_frame(config);
    return status ? "" : status.error().text();
  };
  EXPECT_EQ(fault(MavlinkConfig{}), "");
  EXPECT_EQ(fault(north(0)), "");
  EXPECT_EQ(
      fault(north(-1)),
      "mavlink.frame: local-ned without mavlink.heading_deg; expected the vehicle's heading at the first pose, in "
      "degrees clockwise from true north; or local-frd");
  EXPECT_NE(fault(config_with(&MavlinkConfig::heading_deg, 0)), "");
}

// The covariances are those of what the message says, when the estimate is off by dx: column by column, by disturbing
// it.
void expect_covariances_of_small_disturbances(const LocalFrame& frame) {
  const Vec3 p(1, 2, 3), v(1.5, -2, 0.5), omega(0.3, -0.2, 0.1);
  const Mat3 R = so3_exp(Vec3(0.4, -0.9, 2)), R_VB = so3_exp(Vec3(1, -0.5, 0.3));
  constexpr double kStep = 1e-2;
  const auto disturbed = [&](int column, double by) {
    Eigen::Matrix<double, 16, 1> d = Eigen::Matrix<double, 16, 1>::Zero();
    d[column] = by;
    return odometry_message(
        odometry(p + d.head<3>(), R * so3_exp(d.segment<3>(3)), v + d.segment<3>(6), omega - d.segment<3>(12)), R_VB,
        frame);
  };
  Eigen::Matrix<double, 6, 16> J_pose, J_velocity;
  for (int k = 0; k < 16; ++k) {
    const Odometry plus = disturbed(k, kStep), minus = disturbed(k, -kStep);
    J_pose.col(k) << position(plus) - position(minus), so3_log(attitude(plus) * attitude(minus).transpose());
    J_velocity.col(k) << velocity(plus) - velocity(minus), rates(plus) - rates(minus);
  }
  J_pose /= 2 * kStep;
  J_velocity /= 2 * kStep;
  Covariance root;
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) root(i, j) = std::sin(1.0 + 7 * i + 3 * j * j);
  const Covariance C = root * root.transpose();
  epiline::Odometry o = odometry(p, R, v, omega);
  Eigen::Map<Covariance>(o.covariance.data()) = C;
  const Odometry m = odometry_message(o, R_VB, frame);
  const Mat6 pose = J_pose * C * J_pose.transpose(), motion = J_velocity * C * J_velocity.transpose();
  EXPECT_LT((full(m.pose_covariance) - pose).norm(), 1e-3 * pose.norm());
  EXPECT_LT((full(m.velocity_covariance) - motion).norm(), 1e-3 * motion.norm());
  EXPECT_EQ(vision_position_message(o, R_VB, frame).covariance, m.pose_covariance);
}

TEST(MavlinkOdometry, CovariancesFollowSmallDisturbances) { expect_covariances_of_small_disturbances({}); }

TEST(MavlinkOdometry, CovariancesTurnWithTheWorld) {
  LocalFrame frame(north(200));
  frame.see(odometry({0, 0, 0}, so3_exp(Vec3(0.1, -0.2, 0.7)), {0, 0, 0}, {0, 0, 0}), kLevel);
  expect_covariances_of_small_disturbances(frame);
}

TEST(MavlinkOdometry, AnUnknownCovarianceIsSaidToBe) {
  epiline::Odometry o = odometry({0, 0, 0}, kLevel, {0, 0, 0}, {0, 0, 0});
  o.covariance[17 * 4] = std::numeric_limits<double>::infinity();
  const Odometry m = odometry_message(o, kLevel);
  EXPECT_TRUE(std::isnan(m.pose_covariance[0]));
}

TEST(MavlinkOdometry, QualityAndResets) {
  epiline::Odometry o = odometry({0, 0, 0}, kLevel, {0, 0, 0}, {0, 0, 0});
  const auto quality = [&](HealthState state, int value) {
    o.health = {state, 0, value};
    return static_cast<int>(odometry_message(o, kLevel).quality);
  };
  EXPECT_EQ(quality(HealthState::kTracking, 80), 80);
  EXPECT_EQ(quality(HealthState::kTracking, 0), 1);  // 0 would be "unknown"
  EXPECT_EQ(quality(HealthState::kDegraded, 130), 100);
  EXPECT_EQ(quality(HealthState::kLost, 50), -1);
  EXPECT_EQ(quality(HealthState::kInitialising, 50), -1);
  o.reset_counter = 259;
  EXPECT_EQ(odometry_message(o, kLevel).reset_counter, 3);
}

}  // namespace
}  // namespace epiline::mavlink
