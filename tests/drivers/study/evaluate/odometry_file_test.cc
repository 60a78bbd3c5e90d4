#include "drivers/study/evaluate/odometry_file.h"

#include <gtest/gtest.h>

#include <limits>

#include "pipeline/text/table.h"

namespace epiline {
namespace {

constexpr std::int64_t kStart_ns = 1'403'636'588'763'555'584;

PoseUncertainty uncertainty(std::uint32_t segment, double scale) {
  PoseUncertainty u;
  u.segment = segment;
  u.position << 1, 0.1, 0.2, 0.1, 2, 0.3, 0.2, 0.3, 3;
  u.velocity << 4, 0.4, 0.5, 0.4, 5, 0.6, 0.5, 0.6, 6;
  u.tilt << 7, 0.7, 0.7, 8;
  u.position *= scale;
  u.velocity *= scale;
  u.tilt *= scale;
  u.yaw_variance = 9 * scale;
  return u;
}

TimedPose pose_at(std::int64_t ms) {
  const double s = 1e-3 * static_cast<double>(ms);
  return {HostStamp{kStart_ns} + Span::from_milliseconds(ms), Vec3(s, -2, 1e-5),
          Eigen::Quaterniond(0.1, 0.2 + s, -0.3, 0.4).normalized()};
}

ClaimedTrajectory two_segments() {
  ClaimedTrajectory o;
  o.claims.origins = {{0, pose_at(-5)}, {3, pose_at(70)}};
  for (const std::int64_t ms : {0, 50, 100}) {
    o.trajectory.poses.push_back(pose_at(ms));
    o.trajectory.v_WB_m_s.emplace_back(0.25, -0.5, 1e-3 * static_cast<double>(ms));
    o.claims.poses.push_back(uncertainty(ms < 100 ? 0 : 3, 1e-6 * static_cast<double>(ms + 1)));
  }
  return o;
}

class OdometryFile : public testing::Test {
 protected:
  Result<ClaimedTrajectory> read(const std::string& text) const {
    EXPECT_TRUE(write_text(path, text));
    return read_odometry(path);
  }
  std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "epiline_odometry_file.csv";
};

void expect_pose(const TimedPose& a, const TimedPose& b) {
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_TRUE(a.p_WB.isApprox(b.p_WB, 1e-8));
  EXPECT_LT(a.q_WB.angularDistance(b.q_WB), 1e-7);
}

TEST_F(OdometryFile, KeepsPosesAndClaims) {
  const ClaimedTrajectory wanted = two_segments();
  const auto o = read(odometry_text(wanted));
  ASSERT_TRUE(o) << o.error().text();
  ASSERT_EQ(o->claims.origins.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(o->claims.origins[i].segment, wanted.claims.origins[i].segment);
    expect_pose(o->claims.origins[i].pose, wanted.claims.origins[i].pose);
  }
  ASSERT_EQ(o->trajectory.poses.size(), 3u);
  ASSERT_EQ(o->trajectory.v_WB_m_s.size(), 3u);
  ASSERT_EQ(o->claims.poses.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    expect_pose(o->trajectory.poses[i], wanted.trajectory.poses[i]);
    EXPECT_TRUE(o->trajectory.v_WB_m_s[i].isApprox(wanted.trajectory.v_WB_m_s[i], 1e-8));
    const PoseUncertainty &u = o->claims.poses[i], &w = wanted.claims.poses[i];
    EXPECT_EQ(u.segment, w.segment);
    EXPECT_TRUE(u.position.isApprox(w.position, 1e-8));
    EXPECT_TRUE(u.velocity.isApprox(w.velocity, 1e-8));
    EXPECT_TRUE(u.tilt.isApprox(w.tilt, 1e-8));
    EXPECT_NEAR(u.yaw_variance, w.yaw_variance, 1e-8 * w.yaw_variance);
  }
}

TEST_F(OdometryFile, APoseThatIsNoneLosesItsClaimToo) {
  ClaimedTrajectory o = two_segments();
  o.trajectory.poses[1].p_WB.x() = std::numeric_limits<double>::quiet_NaN();
  const auto got = read(odometry_text(o));
  ASSERT_TRUE(got) << got.error().text();
  EXPECT_EQ(got->trajectory.not_finite, 1u);
  ASSERT_EQ(got->claims.poses.size(), 2u);
  EXPECT_EQ(got->claims.poses[1].segment, 3u);
  ASSERT_EQ(got->trajectory.v_WB_m_s.size(), 2u);
  EXPECT_NEAR(got->trajectory.v_WB_m_s[1].z(), 0.1, 1e-9);
}

TEST_F(OdometryFile, OtherTrajectoriesHaveNoClaims) {
  const auto o = read(tum_text(two_segments().trajectory));
  ASSERT_TRUE(o) << o.error().text();
  EXPECT_EQ(o->trajectory.poses.size(), 3u);
  EXPECT_TRUE(o->claims.poses.empty());
  EXPECT_TRUE(o->claims.origins.empty());
}

TEST_F(OdometryFile, WhatIsWrongIsAnErrorWithItsLine) {
  std::string text = odometry_text(two_segments());
  const std::string header = text.substr(0, text.find('\n') + 1);
  EXPECT_FALSE(read(header));
  text.erase(text.find_last_of(','));
  const auto cut = read(text);
  ASSERT_FALSE(cut);
  EXPECT_NE(cut.error().text().find(":6: 27 values; expected 28"), std::string::npos) << cut.error().text();
  const auto segment = read(header + "1,0,0,0,1,0,0,0,0,0,0,nan,1,0,0,1,0,1,1,1,0,1,1,0,0,1,0,1\n");
  ASSERT_TRUE(segment);
  EXPECT_EQ(segment->claims.poses[0].segment, 0u);
}

}  // namespace
}  // namespace epiline
