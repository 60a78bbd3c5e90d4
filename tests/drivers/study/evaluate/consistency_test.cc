// Normalised errors squared of trajectories drawn from a known covariance: docs/derivations/consistency.md.
#include "drivers/study/evaluate/consistency.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "drivers/study/evaluate/errors.h"

namespace epiline {
namespace {

constexpr std::size_t kPoses = 3000, kOriginIndex = 40, kFirst = 50, kRestart = 1500;
constexpr double kYawSigma = 0.02, kTiltSigma = 0.005;

/// A body that circles, climbs and rocks, with its velocity.
Trajectory circling() {
  Trajectory t;
  for (std::size_t i = 0; i < kPoses; ++i) {
    const double s = 0.05 * static_cast<double>(i);
    const Eigen::Quaterniond q(Eigen::AngleAxisd(0.7 * s, Vec3::UnitZ()) *
                               Eigen::AngleAxisd(0.3 * std::sin(s), Vec3::UnitX()));
    t.poses.push_back({HostStamp{1'000'000'000} + Span::from_seconds(s),
                       Vec3(2 * std::cos(0.7 * s), 2 * std::sin(0.7 * s), 0.1 * s), q});
    t.v_WB_m_s.emplace_back(-1.4 * std::sin(0.7 * s), 1.4 * std::cos(0.7 * s), 0.1);
  }
  return t;
}

/// The flight as odometry sees it: started in motion, so that the first pose published is as uncertain as the others;
/// started anew half way. Each pose's error is one draw of what is claimed.
class Drawn : public testing::Test {
 protected:
  Drawn() {
    L << 0.05, 0, 0, 0.03, 0.02, 0, -0.01, 0.01, 0.1;
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    const auto draw = [&] { return Vec3(normal(random), normal(random), normal(random)); };
    for (std::size_t i = kFirst; i < kPoses; ++i) {
      const std::uint32_t segment = i < kRestart ? 0 : 1;
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(segment == 0 ? 1.0 : 2.5, Vec3::UnitZ()));
      const Vec3 shift = segment == 0 ? Vec3(3, 4, 5) : Vec3(30, 4, 5);
      const auto seen = [&](std::size_t k) {
        return TimedPose{truth.poses[k].stamp, turn * truth.poses[k].p_WB + shift, turn * truth.poses[k].q_WB};
      };
      if (i == kFirst) claims.origins.push_back({0, seen(kOriginIndex)});
      if (i == kRestart) claims.origins.push_back({1, seen(kRestart - 5)});
      TimedPose pose = seen(i);
      pose.p_WB += L * draw();
      const Vec3 rotation = draw().cwiseProduct(Vec3(kTiltSigma, kTiltSigma, kYawSigma));
      pose.q_WB = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()) * pose.q_WB;
      estimate.poses.push_back(pose);
      estimate.v_WB_m_s.push_back(turn * truth.v_WB_m_s[i] + 2 * L * draw());
      claims.poses.push_back({L * L.transpose(), kYawSigma * kYawSigma, segment, 4 * L * L.transpose(),
                              kTiltSigma * kTiltSigma * Eigen::Matrix2d::Identity()});
    }
  }
  Consistency result() const { return evaluate(estimate, truth, claims).nees; }

  Trajectory truth = circling(), estimate;
  Claims claims;
  Mat3 L;
};

TEST_F(Drawn, NeesIsOne) {
  const Consistency c = result();
  ASSERT_TRUE(c.position && c.yaw && c.velocity && c.tilt);
  EXPECT_NEAR(*c.position, 1, 0.05);  // 2950 draws of chi^2/n: sigma 0.015, 0.026, 0.015, 0.018
  EXPECT_NEAR(*c.yaw, 1, 0.1);
  EXPECT_NEAR(*c.velocity, 1, 0.05);
  EXPECT_NEAR(*c.tilt, 1, 0.07);
}

/// Claims errors `ratio` times as large as they are.
void scale(std::vector<PoseUncertainty>& claims, double ratio) {
  for (PoseUncertainty& u : claims) {
    u.position *= ratio * ratio;
    u.yaw_variance *= ratio * ratio;
    u.velocity *= ratio * ratio;
    u.tilt *= ratio * ratio;
  }
}

TEST_F(Drawn, NeesIsFourWhereErrorsAreTwiceWhatIsClaimed) {
  scale(claims.poses, 0.5);
  const Consistency c = result();
  EXPECT_NEAR(*c.position, 4, 0.2);
  EXPECT_NEAR(*c.yaw, 4, 0.4);
  EXPECT_NEAR(*c.velocity, 4, 0.2);
  EXPECT_NEAR(*c.tilt, 4, 0.28);
}

/// Share of errors within the region of probability `claimed` if their standard deviations are `ratio` times the
/// claimed ones: from the chi distribution's density y^(n-1) exp(-y^2/2), summed over small steps.
double expected_share(int n, double claimed, double ratio) {
  constexpr double kStep = 1e-4;
  const auto density = [&](double y) { return std::pow(y, n - 1) * std::exp(-y * y / 2); };
  double whole = 0, sum = 0, edge = 0;
  for (double y = kStep / 2; y < 12; y += kStep) whole += density(y);
  for (; sum < claimed * whole; edge += kStep) sum += density(edge + kStep / 2);
  double inside = 0;
  for (double y = kStep / 2; y < edge / ratio; y += kStep) inside += density(y);
  return inside / whole;
}

/// Within four standard deviations of what so many independent draws give.
void expect_curve(const CalibrationCurve& curve, int n, double ratio) {
  ASSERT_GT(curve.errors, 2900u);
  for (std::size_t i = 0; i < curve.share.size(); ++i) {
    const double share = expected_share(n, kClaimedProbabilities[i], ratio);
    const double sigma = std::sqrt(share * (1 - share) / static_cast<double>(curve.errors));
    EXPECT_NEAR(curve.share[i], share, 4 * sigma) << n << " degrees of freedom, " << kClaimedProbabilities[i];
  }
}

TEST_F(Drawn, CalibrationCurveIsTheDiagonalAndShiftsAsTheChiSquareDistributionSays) {
  EXPECT_NEAR(expected_share(3, 0.3, 1), 0.3, 1e-3);
  const std::vector<PoseUncertainty> honest = claims.poses;
  for (const double ratio : {1.0, 2.0, 0.5}) {  // errors over claimed standard deviations
    claims.poses = honest;
    scale(claims.poses, 1 / ratio);
    const CalibrationCurves curves = result().curves;
    expect_curve(curves.position, 3, ratio);
    expect_curve(curves.velocity, 3, ratio);
    expect_curve(curves.tilt, 2, ratio);
    expect_curve(curves.yaw, 1, ratio);
  }
}

TEST_F(Drawn, AnOriginMayLieBetweenReferences) {
  const HostStamp between = truth.poses[kOriginIndex].stamp + Span::from_milliseconds(25);
  TimedPose origin;
  std::size_t hint = 0;
  ASSERT_TRUE(interpolate(truth, between, longest_gap(truth), origin, hint));
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.0, Vec3::UnitZ()));
  claims.origins[0].pose = {between, turn * origin.p_WB + Vec3(3, 4, 5), turn * origin.q_WB};
  EXPECT_NEAR(*result().position, 1, 0.05);
}

TEST_F(Drawn, OnlySegmentsWithAKnownOriginAreJudged) {
  for (std::size_t i = kRestart - kFirst; i < claims.poses.size(); ++i) claims.poses[i].position /= 100;
  EXPECT_GT(*result().position, 10);
  claims.origins.pop_back();
  EXPECT_NEAR(*result().position, 1, 0.07);
  claims.origins[0].pose.stamp = truth.poses.front().stamp - Span::from_milliseconds(1);
  EXPECT_FALSE(result().position);
}

TEST_F(Drawn, VelocityIsJudgedOnlyAgainstTrueVelocities) {
  truth.v_WB_m_s.clear();
  EXPECT_FALSE(result().velocity);
  EXPECT_TRUE(result().tilt);
}

}  // namespace
}  // namespace epiline
