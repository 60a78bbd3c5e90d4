// The parts around tracker and estimator: rotation from the gyroscope, recorded tracks, the clocks.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "estimator/geometry/so3.h"
#include "pipeline/stages/back_end.h"
#include "pipeline/stages/gyro_rotation.h"
#include "pipeline/stages/recorded_tracks.h"

namespace epiline {
namespace {

HostStamp at(double seconds) { return HostStamp{} + Span::from_seconds(seconds); }

ImuSample reading(double seconds, const Vec3& w) { return {at(seconds), {w.x(), w.y(), w.z()}, {0, 0, 9.81}}; }

TEST(GyroRotation, ConstantRateIsTheExponentialBetweenReadingsToo) {
  const Vec3 w(0.4, -0.7, 1.1), bias(0.01, 0.02, -0.03);
  GyroRotation gyro;
  for (int i = 0; i <= 200; ++i) gyro.add(reading(0.005 * i, w + bias));
  EXPECT_LT((gyro.between(at(0.1234), at(0.7891), bias) - so3_exp(0.6657 * w)).norm(), 1e-7);
}

TEST(GyroRotation, FollowsATurningAxis) {
  // Attitude Rz(2t) Rx(3t): its rate in the body frame is 3 ex + Rx(3t)^T 2 ez.
  const auto attitude = [](double t) -> Mat3 {
    return so3_exp(2 * t * Vec3::UnitZ()) * so3_exp(3 * t * Vec3::UnitX());
  };
  GyroRotation gyro;
  for (int i = 0; i <= 1000; ++i) {
    const double t = 0.001 * i;
    gyro.add(reading(t, 3 * Vec3::UnitX() + so3_exp(3 * t * Vec3::UnitX()).transpose() * (2 * Vec3::UnitZ())));
  }
  EXPECT_LT((gyro.between(at(0.2505), at(0.9), Vec3::Zero()) - attitude(0.2505).transpose() * attitude(0.9)).norm(),
            1e-5);
}

TEST(GyroRotation, LeavesOutBadReadingsAndKeepsTheNewest) {
  const Vec3 w(0, 0, 1);
  GyroRotation gyro;
  EXPECT_TRUE(gyro.between(at(0), at(1), Vec3::Zero()).isIdentity());
  const int count = static_cast<int>(GyroRotation::kCapacity) + 500;
  for (int i = 0; i < count; ++i) {
    gyro.add(reading(0.001 * i, w));
    gyro.add(reading(0.001 * i - 0.0005, 100 * w));  // too late
    gyro.add(reading(0.001 * i + 0.0001, Vec3(std::nan(""), 0, 0)));
  }
  const double end = 0.001 * (count - 1);
  EXPECT_LT((gyro.between(at(end - 0.5), at(end), Vec3::Zero()) - so3_exp(0.5 * w)).norm(), 1e-7);
  // after the last reading: held for one interval, then rest
  const auto past = [&](double s) { return gyro.between(at(end - 0.5), at(end + s), Vec3::Zero()); };
  EXPECT_LT((past(0.0004) - so3_exp(0.5004 * w)).norm(), 1e-7);
  EXPECT_LT((past(0.3) - so3_exp(0.501 * w)).norm(), 1e-7);
  EXPECT_LT((gyro.between(at(end + 0.0002), at(end + 0.0004), Vec3::Zero()) - so3_exp(0.0002 * w)).norm(), 1e-7);
}

TEST(GyroRotation, ACorruptReadingTurnsNothing) {
  const Vec3 w(0.2, 0, 1);
  for (const bool known : {false, true}) {  // whether the reading after the corrupt one is there
    GyroRotation gyro;
    for (int i = 0; i <= (known ? 101 : 100); ++i) gyro.add(reading(0.005 * i, i == 100 ? Vec3(30, 0, 0) : w));
    EXPECT_LT((gyro.between(at(0.45), at(0.499), Vec3::Zero()) - so3_exp(0.049 * w)).norm(), 1e-9) << known;
    EXPECT_LT((gyro.between(at(0.45), at(0.5), Vec3::Zero()) - so3_exp(0.05 * w)).norm(), 1e-9) << known;
  }
}

/// A turn that begins at once: doubted while its first reading is the newest, then taken whole.
TEST(GyroRotation, ATurnThatBeginsAtOnceIsTaken) {
  GyroRotation gyro;
  for (int i = 0; i <= 120; ++i) gyro.add(reading(0.005 * i, i >= 100 ? Vec3(3, 0, 0) : Vec3(0.1, 0, 0)));
  const double angle = 0.1 * 0.045 + 1.55 * 0.005 + 3 * 0.05;
  EXPECT_LT((gyro.between(at(0.45), at(0.55), Vec3::Zero()) - so3_exp(Vec3(angle, 0, 0))).norm(), 1e-9);
}

Camera camera() {
  return Camera({CameraModel::kPinholeRadialTangential, 752, 480, {458, 457, 367, 248}, {-0.28, 0.07, 2e-4, 2e-5, 0}});
}

TEST(RecordedTracks, DescribeWhatTheFrontEndWould) {
  RecordedTracks tracks(camera());
  TrackedFrame frame;
  const TrackPoint first[] = {{7, 100, 200}, {3, 400, 100}}, second[] = {{3, 402, 99}, {9, 10, 10}};
  tracks.step(at(1), first, 2, frame);
  ASSERT_EQ(frame.features.size(), 2u);
  EXPECT_EQ(frame.features[0].id, 3u);
  EXPECT_EQ(frame.features[0].age, 0u);
  tracks.step(at(1.05), second, 2, frame);
  ASSERT_EQ(frame.features.size(), 2u);
  EXPECT_EQ(frame.stamp, at(1.05));
  const TrackedFeature& f = frame.features[0];
  EXPECT_EQ(f.age, 1u);
  EXPECT_NEAR(f.velocity_px_s[0], 40, 1e-3);
  EXPECT_NEAR(f.velocity_px_s[1], -20, 1e-3);
  EXPECT_EQ(frame.features[1].age, 0u);
  Vec3 bearing;
  Mat23 J;
  ASSERT_TRUE(camera().bearing(Vec2(402, 99), bearing, J));
  EXPECT_LT((bearing - Vec3(f.bearing.data())).norm(), 1e-12);
  EXPECT_LT((J - Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(f.pixel_jacobian.data())).norm(), 1e-9);
}

TEST(RecordedTracks, LeavesOutDoubledIdsAndWhatIsTooMuch) {
  RecordedTracks tracks(camera());
  TrackedFrame frame;
  std::vector<TrackPoint> points;
  for (std::uint32_t i = 0; i < kMaxFeatures + 5; ++i) points.push_back({i, 300, 200});
  tracks.step(at(1), points.data(), points.size(), frame);
  EXPECT_EQ(frame.features.size(), kMaxFeatures);
  EXPECT_EQ(tracks.left_out(), 5u);
  const TrackPoint doubled[] = {{1, 300, 200}, {1, 301, 200}, {2, 310, 200}};
  tracks.step(at(2), doubled, 3, frame);
  EXPECT_EQ(frame.features.size(), 2u);
  EXPECT_EQ(tracks.left_out(), 6u);
}

// Clocks that go on with each look: each part lasts as many looks as were taken between its begin and its end.
std::int64_t wall_looks = 0, cpu_looks = 0;
std::int64_t made_up_wall() noexcept { return 1000 * ++wall_looks; }
std::int64_t made_up_cpu() noexcept { return 10 * ++cpu_looks; }

TEST(BackEnd, TimesAStepOnBothClocks) {
  BackEnd stage(EstimatorConfig{}, {made_up_wall, made_up_cpu}, 0);
  TrackedFrame frame;
  frame.stamp = at(1);
  stage.step(frame, BackEnd::kNoDeadline);
  const BackEnd::Times& times = stage.times();
  EXPECT_EQ(times.estimate.wall_ns, 1000 * (wall_looks - 1));
  EXPECT_EQ(times.estimate.cpu_ns, 10 * (cpu_looks - 1));
  EXPECT_GT(cpu_looks, 1);
  EXPECT_EQ(times.solve.wall_ns + times.marginalise.wall_ns, 0) << "without a start nothing is solved";
  EXPECT_EQ(times.solve.cpu_ns + times.marginalise.cpu_ns, 0);
}

TEST(BackEnd, SaysHowLateAStepEnded) {
  BackEnd stage(EstimatorConfig{}, {made_up_wall, made_up_cpu}, 0);
  const auto late_ns = [&](double seconds, std::int64_t deadline_ns) {
    TrackedFrame frame;
    frame.stamp = at(seconds);
    stage.step(frame, deadline_ns);
    return stage.times().late_ns;
  };
  const std::int64_t deadline_ns = 1000 * wall_looks, late = late_ns(1, deadline_ns);
  EXPECT_GT(late, 0);
  EXPECT_EQ(late, 1000 * wall_looks - deadline_ns);
  EXPECT_EQ(late_ns(2, 1000 * wall_looks + 1'000'000), 0);
  EXPECT_EQ(late_ns(3, BackEnd::kNoDeadline), 0);
}

}  // namespace
}  // namespace epiline
