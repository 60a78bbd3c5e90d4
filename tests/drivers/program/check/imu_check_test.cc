#include "drivers/program/check/imu_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

namespace epiline {
namespace {

/// A made-up IMU of 200 Hz that lies still.
struct StillImu {
  double gyroscope_density = 2e-4, accelerometer_density = 2e-3, rate_hz = 200, gravity = 9.81, bias = 0.01;
  std::mt19937 random{3};
  std::normal_distribution<double> normal{};

  ImuSample at(int i) {
    ImuSample s;
    s.stamp = {1'000'000'000 + static_cast<std::int64_t>(i * 1e9 / rate_hz)};
    s.arrival = s.stamp + Span{400'000};
    const double w = gyroscope_density * std::sqrt(rate_hz), a = accelerometer_density * std::sqrt(rate_hz);
    s.angular_velocity_rad_s = {bias + w * normal(random), w * normal(random), w * normal(random)};
    s.specific_force_m_s2 = {a * normal(random), a * normal(random), gravity + a * normal(random)};
    return s;
  }
};

const ImuExpectation kExpected{200, 2e-4, 2e-3};

std::string worst_of(const Findings& findings) {
  Grade worst = Grade::kOk;
  std::string text;
  for (const Finding& f : findings) {
    if (f.grade > worst) text.clear();
    worst = std::max(worst, f.grade);
    if (f.grade == worst) text += f.text + "; " + f.remedy + "\n";
  }
  return kGradeNames[static_cast<std::size_t>(worst)] + std::string(": ") + text;
}

std::string verdict(StillImu imu, int samples = 4000, double sampled_as = 1) {
  ImuCheck check;
  for (int i = 0; i < samples; ++i) {
    ImuSample s = imu.at(i);
    for (double& v : s.specific_force_m_s2) v *= sampled_as;
    check.step(s);
  }
  return worst_of(findings_of(check.result(), kExpected));
}

TEST(ImuCheck, MeasuresWhatWasPutIn) {
  StillImu imu;
  ImuCheck check;
  for (int i = 0; i < 40'000; ++i) check.step(imu.at(i));
  const ImuResult r = check.result();
  EXPECT_NEAR(r.pacing.rate_hz(), 200, 0.01);
  EXPECT_NEAR(r.pacing.delay_s, 0.4e-3, 1e-6);
  EXPECT_GT(r.rest_s, 190);
  for (const double density : r.gyroscope_density) EXPECT_NEAR(density, 2e-4, 0.15 * 2e-4);
  for (const double density : r.accelerometer_density) EXPECT_NEAR(density, 2e-3, 0.15 * 2e-3);
  EXPECT_NEAR(r.gravity_m_s2, 9.81, 0.005);
  EXPECT_NEAR(r.gyroscope_rest_rad_s[0], 0.01, 1e-4);
  EXPECT_EQ(verdict({}).rfind("ok: ", 0), 0u) << verdict({});
}

// Allan's definition, computed straight from it.
TEST(AllanDeviation, IsThatOfTheDefinition) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> values(4096);
  double walk = 0;
  for (double& v : values) v = normal(random) + (walk += 0.05 * normal(random));
  AllanDeviation allan;
  for (const double v : values) allan.step(v);
  for (std::size_t octave = 0; octave < 10; ++octave) {
    const std::size_t m = std::size_t{1} << octave;
    std::vector<double> means;
    for (std::size_t i = 0; i + m <= values.size(); i += m) {
      double sum = 0;
      for (std::size_t k = 0; k < m; ++k) sum += values[i + k];
      means.push_back(sum / static_cast<double>(m));
    }
    double squares = 0;
    for (std::size_t i = 1; i < means.size(); ++i) squares += std::pow(means[i] - means[i - 1], 2);
    EXPECT_NEAR(allan.at(octave), std::sqrt(squares / (2 * static_cast<double>(means.size() - 1))), 1e-12);
    EXPECT_EQ(allan.differences(octave), means.size() - 1);
  }
}

TEST(ImuCheck, NamesFaults) {
  const auto says = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  says(verdict({}, 3), "error: 3 samples");
  says(verdict({.gyroscope_density = 2e-3}), "warning: gyroscope noise");
  says(verdict({.accelerometer_density = 1e-2}), "warning: accelerometer noise");
  says(verdict({}, 4000, 1 / 9.81), "error: the accelerometer measures 1.000 m/s^2 at rest; samples are in g");
  says(verdict({.gravity = 10.3}), "calibrate the accelerometer");
  says(verdict({.gravity = 19.62}), "error: the accelerometer measures 19.620 m/s^2 at rest");
  says(verdict({.bias = 0.2}), "large for a bias");
  says(verdict({.rate_hz = 30}, 600), "error: 30.0 samples per second");
  says(verdict({.rate_hz = 100}, 2000), "200 are configured");
  says(verdict({.accelerometer_density = 0}), "error: 3 of 6 axes never change");
}

// PX4-Autopilot#28340: 14 s of silence at the end of 20 s.
TEST(ImuCheck, ASensorThatDiedIsAnError) {
  StillImu imu;
  ImuCheck check;
  for (int i = 0; i < 1200; ++i) check.step(imu.at(i));
  const HostStamp last = imu.at(1199).arrival;
  const auto text = [&](double after_s) {
    return worst_of(findings_of(check.result(last + Span::from_seconds(after_s)), kExpected));
  };
  EXPECT_EQ(text(0.3).rfind("ok", 0), 0U) << text(0.3);
  EXPECT_EQ(text(14).rfind("error", 0), 0U) << text(14);
  EXPECT_NE(text(14).find("nothing came for the last 14.0 s"), std::string::npos) << text(14);
}

TEST(ImuCheck, PausesAndBadReadingsAreCounted) {
  StillImu imu;
  ImuCheck check;
  for (int i = 0; i < 4000; ++i) {
    if (i % 1000 > 990) continue;  // nine readings are missing, four times (the last ones at the end are nobody's)
    ImuSample s = imu.at(i);
    if (i == 500) s.angular_velocity_rad_s[1] = NAN;
    if (i == 600) s.stamp = s.stamp - Span{100'000'000};
    check.step(s);
  }
  const ImuResult r = check.result();
  EXPECT_EQ(r.not_finite, 1u);
  EXPECT_EQ(r.pacing.backwards, 1u);
  EXPECT_EQ(r.pacing.gaps, 3u + 1u) << "and where the one that went back is missing";
  EXPECT_EQ(r.pacing.missing, 27u + 1u);
}

TEST(ImuCheck, MotionIsNotTakenForNoise) {
  StillImu imu;
  ImuCheck check;
  for (int i = 0; i < 8000; ++i) {
    ImuSample s = imu.at(i);
    if (i / 1000 % 2 == 1) {
      s.angular_velocity_rad_s[2] += 2 * std::sin(0.05 * i);
      s.specific_force_m_s2[0] += 3 * std::sin(0.03 * i);
    }
    check.step(s);
  }
  const ImuResult r = check.result();
  EXPECT_NEAR(r.rest_s, 20, 2.5);
  EXPECT_NEAR(r.gyroscope_density[2], 2e-4, 0.3 * 2e-4);
}

}  // namespace
}  // namespace epiline
