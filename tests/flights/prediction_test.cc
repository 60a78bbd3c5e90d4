// The prediction at the IMU's rate over a recorded flight: does what the next solve says lie where the prediction's
// covariance puts it? docs/derivations/prediction.md
#include "estimator/predict/predictor.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/image_file.h"
#include "estimator/geometry/so3.h"
#include "pipeline/stages/imu_feed.h"
#include "pipeline/stages/offline.h"
#include "platform/linux/realtime.h"
#include "platform/time/monotonic.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

using Covariance = Eigen::Matrix<double, 16, 16, Eigen::RowMajor>;

Mat3 attitude(const Odometry& o) {
  return Eigen::Quaterniond(o.q_WB[0], o.q_WB[1], o.q_WB[2], o.q_WB[3]).toRotationMatrix();
}

/// a - b in the tangent of b.
Eigen::Matrix<double, 15, 1> difference(const Odometry& a, const Odometry& b) {
  const auto vec = [](const std::array<double, 3>& v) { return Vec3(v[0], v[1], v[2]); };
  Eigen::Matrix<double, 15, 1> d;
  d << vec(a.p_WB_m) - vec(b.p_WB_m), so3_log(attitude(b).transpose() * attitude(a)), vec(a.v_WB_m_s) - vec(b.v_WB_m_s),
      vec(a.accelerometer_bias_m_s2) - vec(b.accelerometer_bias_m_s2),
      vec(a.gyroscope_bias_rad_s) - vec(b.gyroscope_bias_rad_s);
  return d;
}

class PredictedFlight : public ::testing::TestWithParam<bool> {};

/// Parameter: whether the IMU's scales are estimated.
TEST_P(PredictedFlight, TheNextSolveLiesWhereThePredictionSays) {
  const auto folder = test::recorded_data("euroc_MH_01");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  auto dataset = open_asl_dataset(folder, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  OfflineSettings settings;
  settings.camera = dataset->camera.parameters;
  settings.estimator.imu = dataset->imu.noise;
  settings.estimator.estimate_imu_scale = GetParam();
  settings.estimator.extrinsics = {dataset->camera.R_BC, dataset->camera.p_BC,
                                   Camera(dataset->camera.parameters).focal_px(), dataset->camera.time_offset_s};
  settings.clocks = {monotonic_ns, thread_cpu_ns};
  OfflinePipeline pipeline(settings);
  PredictorConfig config = predictor_config(settings.estimator);
  config.blend_s = 0;  // the solve itself, carried on to the same reading
  const auto predictor = std::make_unique<Predictor>(config);
  ImageDecoder decoder;
  ImuFeed feed;
  FrameOutcome outcome;
  std::size_t next = 0;
  double nees = 0, expected = 0, position = 0, velocity = 0;
  int n = 0;
  const HostStamp settled = dataset->images.front().stamp + Span::from_milliseconds(5000);
  for (std::size_t i = 0; i < dataset->images.size(); ++i) {
    const HostStamp stamp = dataset->images[i].stamp;
    while (next < dataset->imu_samples.size() && feed.wants_more(pipeline.imu_needed_until(stamp))) {
      pipeline.add_imu(dataset->imu_samples[next]);
      predictor->add_imu(dataset->imu_samples[next]);
      feed.took(dataset->imu_samples[next++]);
    }
    auto frame = decoder.read(i, *dataset);
    ASSERT_TRUE(frame) << frame.error().text();
    frame->stamp = stamp;
    pipeline.step(*frame, outcome);
    if (!outcome.result.solved) continue;
    const bool compared = predictor->state() == Predictor::State::kCurrent && stamp > settled;
    const Odometry before = predictor->odometry();
    predictor->correct(outcome.odometry);
    if (!compared) continue;
    const Odometry after = predictor->odometry();
    ASSERT_EQ(after.stamp, before.stamp);
    const Mat15 P = Covariance(Eigen::Map<const Covariance>(before.covariance.data())).topLeftCorner<15, 15>();
    const Mat15 P_after = Covariance(Eigen::Map<const Covariance>(after.covariance.data())).topLeftCorner<15, 15>();
    const auto d = difference(after, before);
    const Eigen::LLT<Mat15> llt(P);
    ASSERT_EQ(llt.info(), Eigen::Success);
    nees += d.dot(llt.solve(d)) / 15;
    // Of an optimal solve the covariance of the difference is what it takes off the prediction's, in the directions of
    // which it says more: of the others it says on purpose that it knows less. With scales each number by itself: the
    // prediction does not carry what the solve knows of scales and biases together.
    const Eigen::GeneralizedSelfAdjointEigenSolver<Mat15> left(P_after, P, Eigen::EigenvaluesOnly);
    expected += GetParam() ? (1 - P_after.diagonal().array() / P.diagonal().array()).cwiseMax(0).mean()
                           : (1 - left.eigenvalues().array()).cwiseMax(0).mean();
    position += d.head<3>().squaredNorm();
    velocity += d.segment<3>(6).squaredNorm();
    ++n;
  }
  ASSERT_GT(n, 200);
  nees /= n;
  expected /= n;
  std::printf(
      "solves %d: NEES against the prediction %.3f, expected of an optimal solve %.3f; rms %.1f mm, %.1f mm/s\n", n,
      nees, expected, 1e3 * std::sqrt(position / n), 1e3 * std::sqrt(velocity / n));
  EXPECT_LT(nees, 1) << "corrections larger than the prediction's covariance";
  EXPECT_LT(nees, 1.5 * expected);
  EXPECT_GT(nees, expected / 10);
}

INSTANTIATE_TEST_SUITE_P(Scales, PredictedFlight, testing::Bool());

}  // namespace
}  // namespace epiline
