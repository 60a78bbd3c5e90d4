// The errors, against a second computation by another road: 4x4 matrices, Umeyama, plain double loops.
#include "drivers/study/evaluate/errors.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

namespace epiline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr Span kInterval = Span::from_milliseconds(50);

Eigen::Matrix4d matrix(const TimedPose& pose) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = pose.q_WB.toRotationMatrix();
  T.topRightCorner<3, 1>() = pose.p_WB;
  return T;
}

/// A wandering body at 20 Hz.
Trajectory flight(unsigned seed, int count) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto vec = [&] { return Vec3(normal(random), normal(random), normal(random)); };
  Trajectory t;
  TimedPose pose{HostStamp{1'403'636'584'763'555'584}, vec(), Eigen::Quaterniond::UnitRandom()};
  Vec3 v = vec(), w = vec();
  for (int i = 0; i < count; ++i) {
    t.poses.push_back(pose);
    v = 0.98 * v + 0.1 * vec();
    w = 0.95 * w + 0.1 * vec();
    pose.stamp = pose.stamp + kInterval;
    pose.p_WB += 0.05 * v;
    pose.q_WB = (pose.q_WB * Eigen::Quaterniond(Eigen::AngleAxisd(0.05 * w.norm(), w.normalized()))).normalized();
  }
  return t;
}

/// The flight as an odometry would see it: from another origin and heading, with drift in position, scale and attitude.
Trajectory drifted(const Trajectory& truth, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Trajectory t = truth;
  const Eigen::Quaterniond heading(Eigen::AngleAxisd(2.0, Vec3::UnitZ()));
  Vec3 drift = Vec3::Zero();
  for (std::size_t i = 0; i < t.poses.size(); ++i) {
    drift += 0.004 * Vec3(normal(random), normal(random), normal(random));
    const Eigen::Quaterniond tilt(Eigen::AngleAxisd(1e-4 * static_cast<double>(i), Vec3(0.1, 0.2, 1).normalized()));
    t.poses[i].p_WB = heading * (1.03 * truth.poses[i].p_WB) + drift + Vec3(10, -20, 5);
    t.poses[i].q_WB = (heading * truth.poses[i].q_WB * tilt).normalized();
  }
  return t;
}

void expect_summary(const Summary& s, std::vector<double> errors) {
  std::sort(errors.begin(), errors.end());
  double squares = 0, sum = 0;
  for (const double e : errors) {
    squares += e * e;
    sum += e;
  }
  const auto n = static_cast<double>(errors.size());
  EXPECT_NEAR(s.rmse, std::sqrt(squares / n), 1e-6);
  EXPECT_NEAR(s.mean, sum / n, 1e-6);
  const std::size_t middle = errors.size() / 2;
  EXPECT_NEAR(s.median, errors.size() % 2 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]), 1e-6);
  EXPECT_NEAR(s.max, errors.back(), 1e-6);
  EXPECT_GE(s.p95, errors[static_cast<std::size_t>(0.95 * (n - 1))] - 1e-12);
  EXPECT_LE(s.p95, errors[static_cast<std::size_t>(std::ceil(0.95 * (n - 1)))] + 1e-12);
}

std::vector<double> errors_under(const Eigen::Matrix4d& T, const Trajectory& estimate, const Trajectory& truth) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < estimate.poses.size(); ++i) {
    const Eigen::Vector4d moved = T * estimate.poses[i].p_WB.homogeneous();
    errors.push_back((truth.poses[i].p_WB - moved.head<3>()).norm());
  }
  return errors;
}

class ErrorsOfSeed : public testing::TestWithParam<unsigned> {
 protected:
  Trajectory truth = flight(GetParam(), 801), estimate = drifted(truth, 1000 + GetParam());
  TrajectoryErrors errors = evaluate(estimate, truth);
};

TEST_P(ErrorsOfSeed, AbsoluteErrorsAgreeWithUmeyama) {
  Eigen::Matrix3Xd e(3, 801), r(3, 801);
  for (int i = 0; i < 801; ++i) {
    e.col(i) = estimate.poses[static_cast<std::size_t>(i)].p_WB;
    r.col(i) = truth.poses[static_cast<std::size_t>(i)].p_WB;
  }
  ASSERT_EQ(errors.poses, 801u);
  expect_summary(errors.ate_none, errors_under(Eigen::Matrix4d::Identity(), estimate, truth));
  expect_summary(errors.ate_se3, errors_under(Eigen::umeyama(e, r, false), estimate, truth));
  const Eigen::Matrix4d sim3 = Eigen::umeyama(e, r, true);
  expect_summary(errors.ate_sim3, errors_under(sim3, estimate, truth));
  EXPECT_NEAR(errors.scale_error, 1 / std::cbrt(sim3.topLeftCorner<3, 3>().determinant()) - 1, 1e-9);
  // Four degrees of freedom are the rigid motion in the plane, and a shift along z.
  const Eigen::MatrixXd e_xy = e.topRows(2), r_xy = r.topRows(2);
  const Eigen::MatrixXd planar = Eigen::umeyama(e_xy, r_xy, false);
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<2, 2>() = planar.topLeftCorner(2, 2);
  T.block<2, 1>(0, 3) = planar.topRightCorner(2, 1);
  T(2, 3) = (r.row(2) - e.row(2)).mean();
  expect_summary(errors.ate_4dof, errors_under(T, estimate, truth));
}

TEST_P(ErrorsOfSeed, RelativeErrorsAgreeWithADoubleLoopOverMatrices) {
  ASSERT_GE(errors.rpe.size(), 3u);
  for (const RelativeError& rpe : errors.rpe) {
    double translation = 0, rotation = 0;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i < truth.poses.size(); ++i) {
      double length = 0;
      for (std::size_t j = i + 1; j < truth.poses.size(); ++j) {
        length += (truth.poses[j].p_WB - truth.poses[j - 1].p_WB).norm();
        if (length < rpe.distance_m) continue;
        const Eigen::Matrix4d true_motion = matrix(truth.poses[i]).inverse() * matrix(truth.poses[j]);
        const Eigen::Matrix4d motion = matrix(estimate.poses[i]).inverse() * matrix(estimate.poses[j]);
        const Eigen::Matrix4d error = true_motion.inverse() * motion;
        translation += error.topRightCorner<3, 1>().norm();
        rotation += std::acos(std::clamp((error.topLeftCorner<3, 3>().trace() - 1) / 2, -1.0, 1.0));
        ++pairs;
        break;
      }
    }
    ASSERT_EQ(rpe.pairs, pairs);
    EXPECT_NEAR(rpe.translation_percent, 100 * translation / static_cast<double>(pairs) / rpe.distance_m, 1e-6);
    EXPECT_NEAR(rpe.rotation_deg, rotation / static_cast<double>(pairs) * 180 / kPi,
                1e-4);  // acos loses digits near zero
  }
}

TEST_P(ErrorsOfSeed, MotionErrorsAgreeWithADoubleLoopOverMatrices) {
  ASSERT_EQ(errors.motion.size(), 3u);
  for (const auto& [e, images] : {std::pair{errors.motion[0], 20}, {errors.motion[1], 100}, {errors.motion[2], 400}}) {
    EXPECT_EQ(e.seconds, 0.05 * images);
    std::vector<double> translations, rotations;
    for (std::size_t i = 0, j = static_cast<std::size_t>(images); j < truth.poses.size(); ++i, ++j) {
      const Eigen::Matrix4d motion = matrix(estimate.poses[i]).inverse() * matrix(estimate.poses[j]);
      const Eigen::Matrix4d true_motion = matrix(truth.poses[i]).inverse() * matrix(truth.poses[j]);
      translations.push_back((motion - true_motion).topRightCorner<3, 1>().norm());
      const Eigen::Matrix3d R = true_motion.topLeftCorner<3, 3>().transpose() * motion.topLeftCorner<3, 3>();
      rotations.push_back(Eigen::AngleAxisd(R).angle() * 180 / kPi);
    }
    ASSERT_EQ(e.translation_m.count, translations.size());
    expect_summary(e.translation_m, translations);
    expect_summary(e.rotation_deg, rotations);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, ErrorsOfSeed, testing::Range(1u, 9u));

TEST(Errors, YawDriftIsTheSlopeTimesTheTimeAlsoAcrossHalfATurn) {
  const Trajectory truth = flight(5, 401);  // 20 s
  for (const double offset : {0.0, 3.1, -3.1}) {
    Trajectory estimate = truth;
    for (std::size_t i = 0; i < 401; ++i) {
      const double yaw = offset + 0.01 * 0.05 * static_cast<double>(i);  // 0.01 rad/s too fast
      estimate.poses[i].q_WB = Eigen::AngleAxisd(yaw, Vec3::UnitZ()) * truth.poses[i].q_WB;
    }
    EXPECT_NEAR(evaluate(estimate, truth).yaw_drift_deg, -0.01 * 19 * 180 / kPi,
                1e-6);  // means of the first and last second
  }
}

TEST(Errors, MotionIsJudgedOverLengthsThatTheEstimateHas) {
  const Trajectory truth = flight(5, 801);  // 40 s
  const Trajectory whole = drifted(truth, 6);
  Trajectory sparse;  // every 0.7 s: nothing is about 1 s or 5 s later, but 20.3 s
  for (std::size_t i = 0; i < whole.poses.size(); i += 14) sparse.poses.push_back(whole.poses[i]);
  const TrajectoryErrors e = evaluate(sparse, truth);
  ASSERT_EQ(e.motion.size(), 1u);
  EXPECT_EQ(e.motion[0].seconds, 20);
  EXPECT_EQ(e.motion[0].translation_m.count, sparse.poses.size() - 29);
  EXPECT_TRUE(evaluate(flight(5, 10), truth).motion.empty());
}

TEST(Associate, InterpolatesAndLeavesOutGapsAndTheOutside) {
  Trajectory reference;
  for (const std::int64_t ms : {0, 10, 20, 30, 500, 510, 520}) {
    TimedPose pose{HostStamp{} + Span::from_milliseconds(ms), Vec3(0.001 * static_cast<double>(ms), 0, 0), {}};
    pose.q_WB = Eigen::AngleAxisd(0.001 * static_cast<double>(ms), Vec3::UnitY());
    reference.poses.push_back(pose);
  }
  Trajectory estimate;
  for (const std::int64_t ms : {-5, 0, 14, 30, 200, 500, 520, 521}) {
    estimate.poses.push_back({HostStamp{} + Span::from_milliseconds(ms), Vec3::Zero(), Eigen::Quaterniond::Identity()});
  }
  const auto pairs = associate(estimate, reference);
  ASSERT_EQ(pairs.size(), 5u);
  const std::size_t expected[] = {1, 2, 3, 5, 6};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(pairs[i].index, expected[i]);
    const double t = (pairs[i].estimate.stamp - HostStamp{}).seconds();
    EXPECT_NEAR(pairs[i].reference.p_WB.x(), t, 1e-12);
    EXPECT_NEAR(pairs[i].reference.q_WB.angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(t, Vec3::UnitY()))), 0,
                1e-7);
  }
}

TEST(Associate, TakesTheUsualIntervalOfASlowReferenceForNoGap) {
  Trajectory reference = flight(2, 20), estimate = flight(2, 191);
  for (std::size_t i = 0; i < 20; ++i) reference.poses[i].stamp = estimate.poses[10 * i].stamp;  // every 0.5 s
  EXPECT_EQ(associate(estimate, reference).size(), 191u);
}

TEST(Errors, NothingInCommonIsNoPose) {
  Trajectory late = flight(1, 10);
  for (TimedPose& pose : late.poses) pose.stamp = pose.stamp + Span::from_seconds(100);
  EXPECT_EQ(evaluate(late, flight(1, 10)).poses, 0u);
}

}  // namespace
}  // namespace epiline
