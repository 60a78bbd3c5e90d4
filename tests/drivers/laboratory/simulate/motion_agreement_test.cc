#include "drivers/laboratory/simulate/motion_agreement.h"

#include <gtest/gtest.h>

#include <vector>

#include "drivers/flights/motion/random.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr double kInterval_s = 0.2, kBias_g = 0.03, kBias_a = -0.2;
constexpr int kSeconds = 240;

/// A motion known to the last bit, with constant biases.
FittedMotion random_motion() {
  Random random(11, 0);
  std::vector<Vec3> p;
  std::vector<Mat3> R{Mat3::Identity()};
  Vec3 walk = Vec3::Zero();
  for (int i = 0; i < kSeconds * 5 + 3; ++i) {
    walk = 0.98 * walk + random.normal3(0.1);
    p.push_back(walk);
    if (i > 0) R.push_back(R.back() * so3_exp(random.normal3(0.05)));
  }
  const std::vector<Vec3> b_g(2, Vec3::Constant(kBias_g)), b_a(2, Vec3::Constant(kBias_a));
  return {HostStamp{5'000'000'000},
          kSeconds,
          {.position = {kInterval_s, p}, .rotation = {kInterval_s, R}},
          {.gyroscope = {1, b_g}, .accelerometer = {1, b_a}}};
}

/// Its readings, with noise of `factor` times the default densities and no walk of the biases.
std::vector<ImuSample> readings_of(const FittedMotion& motion, double factor) {
  ImuModel model;
  model.gyroscope_bias_sigma = model.accelerometer_bias_sigma = 0;
  model.noise = {model.noise.gyroscope_density * factor, 0, model.noise.accelerometer_density * factor, 0};
  ImuSimulator simulator(model, Random(12, 0));
  std::vector<ImuSample> imu;
  for (int i = 0; i <= kSeconds * 200; ++i) {
    ImuSample s = simulator.read(motion.begin() + Span{i * 5'000'000ll}, motion.at(i * 0.005));
    for (double& w : s.angular_velocity_rad_s) w += kBias_g;
    for (double& a : s.specific_force_m_s2) a += kBias_a;
    imu.push_back(s);
  }
  return imu;
}

ImuNoise no_walk() {
  ImuNoise noise;
  noise.gyroscope_random_walk = noise.accelerometer_random_walk = 0;
  return noise;
}

TEST(MotionAgreement, TheTrueMotionDisagreesByTheNoiseAlone) {
  const FittedMotion motion = random_motion();
  const std::vector<ImuSample> imu = readings_of(motion, 1);
  const SampleAgreement samples = sample_agreement(motion, imu, no_walk());
  EXPECT_NEAR(samples.gyroscope.rms / samples.gyroscope.predicted, 1, 0.01);
  EXPECT_NEAR(samples.accelerometer.rms / samples.accelerometer.predicted, 1, 0.01);
  EXPECT_NEAR(samples.gyroscope_p95 / samples.gyroscope.predicted, 1.96, 0.03);
  for (const double interval_s : {0.1, 0.5, 1.0}) {
    const IntegratedAgreement a = integrated_agreement(motion, imu, no_walk(), interval_s);
    EXPECT_GE(a.count, static_cast<int>(kSeconds / interval_s) - 1);
    const double tolerance = 4 * std::sqrt(2 / (9.0 * a.count));  // four standard deviations of a mean of chi squares
    EXPECT_NEAR(a.nees, 1, tolerance) << interval_s;
    EXPECT_NEAR(a.rotation.rms / a.rotation.predicted, 1, tolerance) << interval_s;
    EXPECT_NEAR(a.velocity.rms / a.velocity.predicted, 1, tolerance) << interval_s;
    EXPECT_NEAR(a.position.rms / a.position.predicted, 1, tolerance) << interval_s;
    // the white noise alone, in closed form: a random walk of the rotation
    EXPECT_NEAR(a.rotation.predicted, no_walk().gyroscope_density * std::sqrt(interval_s), 1e-7);
  }
}

TEST(MotionAgreement, ThreeTimesTheNoiseIsSeen) {
  const FittedMotion motion = random_motion();
  const std::vector<ImuSample> imu = readings_of(motion, 3);
  EXPECT_NEAR(integrated_agreement(motion, imu, no_walk(), 0.5).nees, 9, 1);
}

TEST(MotionAgreement, NothingInCommonIsNothing) {
  const FittedMotion motion = random_motion();
  EXPECT_EQ(integrated_agreement(motion, {}, no_walk(), 0.5).count, 0);
  EXPECT_EQ(sample_agreement(motion, {}, no_walk()).gyroscope.rms, 0);
}

}  // namespace
}  // namespace epiline
