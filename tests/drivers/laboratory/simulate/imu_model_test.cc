#include "drivers/laboratory/simulate/imu_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

ImuModel perfect(double rate_hz) {
  ImuModel model;
  model.rate_hz = rate_hz;
  model.noise = {0, 0, 0, 0};
  model.gyroscope_bias_sigma = model.accelerometer_bias_sigma = 0;
  return model;
}

Motion resting() {
  Motion m;
  m.p_WB = m.v_WB = m.a_WB = m.omega_B = Vec3::Zero();
  m.R_WB.setIdentity();
  return m;
}

/// Dead reckoning from the readings alone; midpoint rule.
TEST(ImuSimulatorTest, PerfectReadingsIntegrateBackToTheTrajectory) {
  constexpr double kRate_hz = 1000, kSeconds = 20;
  for (const FlightKind kind : kAllFlights) {
    Random random(5, 0);
    const Flight flight = make_flight(kind, random);
    ImuSimulator imu(perfect(kRate_hz), Random(5, 1));
    Motion start = flight.at(0);
    Vec3 p = start.p_WB, v = start.v_WB;
    Mat3 R = start.R_WB;
    ImuSample last = imu.read({}, start);
    const int steps = static_cast<int>(kSeconds * kRate_hz);
    for (int k = 1; k <= steps; ++k) {
      const ImuSample now = imu.read({}, flight.at(k / kRate_hz));
      const double dt = 1 / kRate_hz;
      const Mat3 R_next =
          R * so3_exp(0.5 * dt * (vec3(last.angular_velocity_rad_s) + vec3(now.angular_velocity_rad_s)));
      const Vec3 a =
          0.5 * (R * vec3(last.specific_force_m_s2) + R_next * vec3(now.specific_force_m_s2)) + Vec3(0, 0, -9.81);
      p += dt * v + 0.5 * dt * dt * a;
      v += dt * a;
      R = R_next;
      last = now;
    }
    const Motion end = flight.at(kSeconds);
    EXPECT_LT((p - end.p_WB).norm(), 2e-3) << to_string(kind);
    EXPECT_LT((v - end.v_WB).norm(), 2e-4) << to_string(kind);
    EXPECT_LT(so3_log(R.transpose() * end.R_WB).norm(), 1e-5) << to_string(kind);
  }
}

TEST(ImuSimulatorTest, WhiteNoiseHasItsDensity) {
  ImuModel model = perfect(200);
  model.noise.gyroscope_density = 1e-3;
  model.noise.accelerometer_density = 2e-2;
  ImuSimulator imu(model, Random(1, 1));
  // the mean of one second has the standard deviation density / sqrt(1 s), one reading density * sqrt(200 Hz)
  double w2 = 0, a2 = 0, w2_mean = 0;
  constexpr int kSeconds = 400;
  for (int s = 0; s < kSeconds; ++s) {
    Vec3 mean = Vec3::Zero();
    for (int k = 0; k < 200; ++k) {
      const ImuSample sample = imu.read({}, resting());
      const Vec3 w = vec3(sample.angular_velocity_rad_s), a = vec3(sample.specific_force_m_s2) - Vec3(0, 0, 9.81);
      w2 += w.squaredNorm() / (3 * 200.0 * kSeconds);
      a2 += a.squaredNorm() / (3 * 200.0 * kSeconds);
      mean += w / 200;
    }
    w2_mean += mean.squaredNorm() / (3.0 * kSeconds);
  }
  EXPECT_NEAR(std::sqrt(w2), 1e-3 * std::sqrt(200), 1e-3 * std::sqrt(200) * 0.01);
  EXPECT_NEAR(std::sqrt(a2), 2e-2 * std::sqrt(200), 2e-2 * std::sqrt(200) * 0.01);
  EXPECT_NEAR(std::sqrt(w2_mean), 1e-3, 1e-4);
}

TEST(ImuSimulatorTest, BiasesStartAndWalkAsTold) {
  ImuModel model = perfect(200);
  model.gyroscope_bias_sigma = 0.01;
  model.accelerometer_bias_sigma = 0.08;
  model.noise.gyroscope_random_walk = 2e-3;
  model.noise.accelerometer_random_walk = 3e-3;
  constexpr int kRuns = 600;
  double g0 = 0, a0 = 0, g4 = 0, a4 = 0;
  for (int run = 0; run < kRuns; ++run) {
    ImuSimulator imu(model, Random(static_cast<std::uint64_t>(run), 1));
    const Vec3 b_g = imu.gyroscope_bias(), b_a = imu.accelerometer_bias();
    const ImuSample first = imu.read({}, resting());
    EXPECT_LT((vec3(first.angular_velocity_rad_s) - b_g).norm(), 1e-15);
    EXPECT_LT((vec3(first.specific_force_m_s2) - Vec3(0, 0, 9.81) - b_a).norm(), 1e-14);
    for (int k = 1; k < 800; ++k) imu.read({}, resting());  // 4 s in all
    g0 += b_g.squaredNorm() / (3 * kRuns);
    a0 += b_a.squaredNorm() / (3 * kRuns);
    g4 += (imu.gyroscope_bias() - b_g).squaredNorm() / (3 * kRuns);
    a4 += (imu.accelerometer_bias() - b_a).squaredNorm() / (3 * kRuns);
  }
  EXPECT_NEAR(std::sqrt(g0), 0.01, 0.0008);
  EXPECT_NEAR(std::sqrt(a0), 0.08, 0.0064);
  EXPECT_NEAR(std::sqrt(g4), 2e-3 * 2, 3e-4);
  EXPECT_NEAR(std::sqrt(a4), 3e-3 * 2, 5e-4);
}

TEST(ImuSimulatorTest, ScaleMisalignmentAndLimits) {
  ImuModel model = perfect(200);
  model.gyroscope_matrix(0, 1) = 0.1;
  model.accelerometer_matrix(2, 2) = 1.5;
  model.accelerometer_limit_m_s2 = 14;
  model.gyroscope_limit_rad_s = 2.5;
  ImuSimulator imu(model, Random(1, 1));
  Motion m = resting();
  m.omega_B = Vec3(1, 2, -3);
  const ImuSample s = imu.read(HostStamp{17}, m);
  EXPECT_EQ(s.stamp.ns, 17);
  EXPECT_LT((vec3(s.angular_velocity_rad_s) - Vec3(1.2, 2, -2.5)).norm(), 1e-14);
  EXPECT_LT((vec3(s.specific_force_m_s2) - Vec3(0, 0, 14)).norm(), 1e-14);
}

/// Amplitude of the sine of that frequency (Goertzel's filter); `values` span whole periods.
double amplitude(const std::vector<double>& values, double frequency_hz, double rate_hz) {
  const double step = 2 * std::numbers::pi * frequency_hz / rate_hz;
  double s1 = 0, s2 = 0;
  for (const double v : values) {
    const double s0 = v + 2 * std::cos(step) * s1 - s2;
    s2 = s1;
    s1 = s0;
  }
  const double power = s1 * s1 + s2 * s2 - 2 * std::cos(step) * s1 * s2;
  return 2 / static_cast<double>(values.size()) * std::sqrt(power);
}

TEST(ImuSimulatorTest, VibrationsAreLinesOfTheSpectrum) {
  ImuModel model = perfect(200);
  const Vec3 axis = Vec3(1, 2, 2) / 3;
  model.vibrations = {{.frequency_hz = 62, .acceleration_m_s2 = 0.9, .rate_rad_s = 0.06, .axis = axis, .phase_rad = 1},
                      {.frequency_hz = 170, .acceleration_m_s2 = 0.3}};  // read as 30 Hz
  ImuSimulator imu(model, Random(1, 1));
  std::vector<double> a_x, a_z, w_y;
  for (int k = 0; k < 2000; ++k) {
    const ImuSample s = imu.read(HostStamp{7'000'000'000 + k * 5'000'000ll}, resting());
    a_x.push_back(s.specific_force_m_s2[0]);
    a_z.push_back(s.specific_force_m_s2[2] - 9.81);
    w_y.push_back(s.angular_velocity_rad_s[1]);
  }
  EXPECT_NEAR(amplitude(a_x, 62, 200), 0.9 / 3, 1e-9);
  EXPECT_NEAR(amplitude(a_x, 30, 200), 0, 1e-9);
  EXPECT_NEAR(amplitude(a_z, 62, 200), 0.9 * 2 / 3, 1e-9);
  EXPECT_NEAR(amplitude(a_z, 30, 200), 0.3, 1e-9);
  EXPECT_NEAR(amplitude(a_z, 47, 200), 0, 1e-9);
  EXPECT_NEAR(amplitude(w_y, 62, 200), 0.06 * 2 / 3, 1e-9);
}

TEST(RandomAxes, HaveTheirSigmas) {
  Random random(1, 0);
  double scale = 0, misalignment = 0;
  constexpr int kDraws = 2000;
  for (int i = 0; i < kDraws; ++i) {
    const Mat3 error = random_axes(0.01, 0.002, random) - Mat3::Identity();
    scale += error.diagonal().squaredNorm() / (3 * kDraws);
    misalignment += (error.squaredNorm() - error.diagonal().squaredNorm()) / (6 * kDraws);
  }
  EXPECT_NEAR(std::sqrt(scale), 0.01, 0.0004);
  EXPECT_NEAR(std::sqrt(misalignment), 0.002, 0.0001);
  EXPECT_EQ(random_axes(0, 0, random), Mat3::Identity());
}

}  // namespace
}  // namespace epiline
