#include "pipeline/text/trajectory.h"

#include <gtest/gtest.h>

#include <fstream>

namespace epiline {
namespace {

namespace fs = std::filesystem;

class TrajectoryFile : public testing::Test {
 protected:
  ~TrajectoryFile() override { fs::remove(path_); }
  Result<Trajectory> read(const std::string& text) {
    std::ofstream(path_) << text;
    return read_trajectory(path_);
  }
  fs::path path_ = fs::path(testing::TempDir()) / "epiline_trajectory_test.txt";
};

TEST_F(TrajectoryFile, GroundTruthHasPoseVelocityAndBothBiases) {
  const auto t = read("#t, p, q, v, b_w, b_a\n5000000000,1,2,3,0.8,0.6,0,0,4,5,6,0.07,0.08,0.09,0.1,0.11,0.12\n");
  ASSERT_TRUE(t) << t.error().text();
  ASSERT_EQ(t->poses.size(), 1u);
  EXPECT_EQ(t->poses[0].stamp.ns, 5'000'000'000);
  EXPECT_EQ(t->poses[0].p_WB, Vec3(1, 2, 3));
  EXPECT_NEAR(t->poses[0].q_WB.w(), 0.8, 1e-12);
  EXPECT_NEAR(t->poses[0].q_WB.x(), 0.6, 1e-12);
  EXPECT_EQ(t->v_WB_m_s.at(0), Vec3(4, 5, 6));
  EXPECT_EQ(t->gyroscope_bias_rad_s.at(0), Vec3(0.07, 0.08, 0.09));
  EXPECT_EQ(t->accelerometer_bias_m_s2.at(0), Vec3(0.1, 0.11, 0.12));
}

TEST_F(TrajectoryFile, WhatItWritesItReads) {
  const auto t = read("5.000000001 1 2 3 0.6 0 0 0.8\n5.05 4 5 6 0 0 0 1\n");
  ASSERT_TRUE(t) << t.error().text();
  ASSERT_EQ(t->poses.size(), 2u);
  EXPECT_EQ(t->poses[0].stamp.ns, 5'000'000'001);
  EXPECT_NEAR(t->poses[0].q_WB.x(), 0.6, 1e-12) << "w is last";
  EXPECT_TRUE(t->v_WB_m_s.empty());
  EXPECT_TRUE(t->gyroscope_bias_rad_s.empty());
  const auto again = read(tum_text(*t));
  ASSERT_TRUE(again) << again.error().text();
  ASSERT_EQ(again->poses.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again->poses[i].stamp, t->poses[i].stamp);
    EXPECT_NEAR((again->poses[i].p_WB - t->poses[i].p_WB).norm(), 0, 1e-6);
    EXPECT_NEAR(again->poses[i].q_WB.angularDistance(t->poses[i].q_WB), 0, 1e-6);
  }
}

TEST_F(TrajectoryFile, AHeaderSaysWhereWIs) {
  const Eigen::Quaterniond q(0.8, 0.6, 0, 0);
  for (const char* text :
       {"#timestamp tx ty tz qw qx qy qz\n5.0 1 2 3 0.8 0.6 0 0\n",
        "# made in 2024\n# t x y z qx qy qz qw\n5 1 2 3 0.6 0 0 0.8\n",
        "timestamp tx ty tz qw qx qy qz\n5.0 1 2 3 0.8 0.6 0 0\n",
        "#timestamp [ns], p_RS_R_x [m], p_y, p_z, q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z "
        "[]\n5000000000,1,2,3,0.8,0.6,0,0\n",
        "#time,x,y,z,qx,qy,qz,qw\n5000000000,1,2,3,0.6,0,0,0.8\n", "#time,x,y,z\n5000000000,1,2,3,0.8,0.6,0,0\n"}) {
    const auto t = read(text);
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->poses.at(0).stamp.ns, 5'000'000'000) << text;
    EXPECT_NEAR(t->poses.at(0).q_WB.angularDistance(q), 0, 1e-7) << text;
  }
}

TEST_F(TrajectoryFile, RowsWithoutAPoseOrOutOfOrderAreLeftOutAndCounted) {
  const auto t = read("1 0 0 0 0 0 0 1\n2 nan 0 0 0 0 0 1\n3 0 0 0 0 0 0 0\n1 0 0 0 0 0 0 1\n4 1 0 0 0 0 0 1.5\n");
  ASSERT_TRUE(t) << t.error().text();
  EXPECT_EQ(t->poses.size(), 2u);
  EXPECT_EQ(t->not_finite, 2u);
  EXPECT_EQ(t->out_of_order, 1u);
  EXPECT_NEAR(t->worst_norm_error, 0.5, 1e-12);
  EXPECT_EQ(t->worst_norm_at.ns, 4'000'000'000);
  EXPECT_NEAR(t->poses[1].q_WB.norm(), 1, 1e-12);
}

TEST_F(TrajectoryFile, WithoutAPoseItIsAnError) {
  EXPECT_FALSE(read("# nothing\n"));
  EXPECT_FALSE(read("1 nan 0 0 0 0 0 1\n"));
  EXPECT_FALSE(read("1 a 0 0 0 0 0 1\n"));
  EXPECT_FALSE(read_trajectory(path_.string() + ".missing"));
}

TEST(InterpolatedPose, LiesBetweenItsNeighboursAndNotInGaps) {
  Trajectory t;
  const auto at = [](double s) { return HostStamp{static_cast<std::int64_t>(s * 1e9)}; };
  const auto turned = [](double rad) { return Eigen::Quaterniond(Eigen::AngleAxisd(rad, Vec3::UnitZ())); };
  ASSERT_TRUE(add_pose({at(1), Vec3(0, 0, 0), turned(0)}, t));
  ASSERT_TRUE(add_pose({at(2), Vec3(4, 0, 0), turned(0.4)}, t));
  ASSERT_TRUE(add_pose({at(9), Vec3(5, 0, 0), turned(0.5)}, t));
  TimedPose pose;
  std::size_t hint = 0;
  ASSERT_TRUE(interpolate(t, at(1.25), Span::from_seconds(1), pose, hint));
  EXPECT_NEAR(pose.p_WB.x(), 1, 1e-9);
  EXPECT_NEAR(pose.q_WB.angularDistance(turned(0.1)), 0, 1e-6);
  EXPECT_FALSE(interpolate(t, at(5), Span::from_seconds(1), pose, hint)) << "a gap";
  EXPECT_TRUE(interpolate(t, at(5), Span::from_seconds(10), pose, hint));
  EXPECT_FALSE(interpolate(t, at(0.9), Span::from_seconds(1), pose, hint)) << "before the first";
  EXPECT_FALSE(interpolate(t, at(9.1), Span::from_seconds(1), pose, hint)) << "after the last";
}

}  // namespace
}  // namespace epiline
