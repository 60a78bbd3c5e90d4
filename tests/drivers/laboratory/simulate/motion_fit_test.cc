#include "drivers/laboratory/simulate/motion_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "drivers/flights/motion/random.h"
#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/laboratory/simulate/flights.h"
#include "drivers/laboratory/simulate/imu_model.h"
#include "drivers/study/evaluate/alignment.h"
#include "estimator/geometry/so3.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

constexpr HostStamp kBegin{1'000'000'000'000};
constexpr double kDeg = std::numbers::pi / 180, kLength_s = 20;

/// How the truth is recorded.
struct Recording {
  double rate_hz = 100, position_sigma_m = 0.002, rotation_sigma_rad = 0.2 * kDeg;
  Vec3 tilt = Vec3::Zero(), mount = Vec3::Zero(), p_BM = Vec3::Zero();
  double time_offset_s = 0;  ///< t_IMU = t_truth + time_offset
  double gap_begin_s = 0, gap_end_s = 0;
  double outlier_share = 0;
};

struct Case {
  Flight flight;
  std::vector<ImuSample> imu;
  Trajectory truth;

  explicit Case(const Recording& recording, std::uint64_t seed = 1, FlightKind kind = FlightKind::kAgile) {
    Random random(seed, 0);
    flight = make_flight(kind, random);
    ImuSimulator simulator({}, Random(seed, 1));
    for (double t = 0; t < kLength_s; t += 0.005)
      imu.push_back(simulator.read(kBegin + Span::from_seconds(t), flight.at(t)));
    const Mat3 R_TW = so3_exp(recording.tilt).transpose();
    for (double t = 0.1; t < kLength_s - 0.1; t += 1 / recording.rate_hz) {
      if (t > recording.gap_begin_s && t < recording.gap_end_s) continue;
      const Motion m = flight.at(t);
      Vec3 p = R_TW * (m.p_WB + m.R_WB * recording.p_BM) + random.normal3(recording.position_sigma_m);
      if (random.chance(recording.outlier_share)) p += random.normal3(1);
      const Mat3 R = R_TW * m.R_WB * so3_exp(recording.mount) * so3_exp(random.normal3(recording.rotation_sigma_rad));
      truth.poses.push_back({kBegin + Span::from_seconds(t - recording.time_offset_s), p, Eigen::Quaterniond(R)});
    }
  }

  Result<MotionFit> fit(const FitSettings& settings = {}) const { return fit_motion(imu, ImuNoise{}, truth, settings); }
};

/// The fit trusts the truth as much as it deserves.
FitSettings trusting(const Recording& recording) {
  FitSettings settings;
  settings.position_density = recording.position_sigma_m / std::sqrt(recording.rate_hz);
  settings.rotation_density = recording.rotation_sigma_rad / std::sqrt(recording.rate_hz);
  return settings;
}

struct Errors {
  double position_m = 0, rotation_rad = 0, tilt_rad = 0, velocity_m_s = 0;  ///< rms
};

/// After alignment in yaw and translation.
Errors errors(const FittedMotion& fitted, const Flight& flight) {
  std::vector<Vec3> estimate, reference;
  const double shift = (fitted.begin() - kBegin).seconds();
  for (double t = 0; t < fitted.duration_s(); t += 0.01) {
    estimate.push_back(fitted.at(t).p_WB);
    reference.push_back(flight.at(t + shift).p_WB);
  }
  const Similarity S = align(Alignment::k4Dof, estimate, reference);
  Errors e;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const double t = 0.01 * static_cast<double>(i);
    const Motion m = fitted.at(t), truth = flight.at(t + shift);
    e.position_m += (S(m.p_WB) - truth.p_WB).squaredNorm();
    e.velocity_m_s += (S.R * m.v_WB - truth.v_WB).squaredNorm();
    const Vec3 turn_W = so3_log(S.R * m.R_WB * truth.R_WB.transpose());
    e.rotation_rad += turn_W.squaredNorm();
    e.tilt_rad += turn_W.head<2>().squaredNorm();
  }
  const double n = static_cast<double>(estimate.size());
  return {std::sqrt(e.position_m / n), std::sqrt(e.rotation_rad / n), std::sqrt(e.tilt_rad / n),
          std::sqrt(e.velocity_m_s / n)};
}

TEST(MotionFit, ReturnsTheMotionThatMadeTheReadings) {
  const Recording recording;
  const Case c(recording);
  const auto fit = c.fit(trusting(recording));
  ASSERT_TRUE(fit) << fit.error().text();
  const Errors e = errors(fit->motion, c.flight);
  // 2 mm and 0.2 deg in each single pose, averaged by the IMU over about a second
  EXPECT_LT(e.position_m, 0.7e-3);
  EXPECT_LT(e.velocity_m_s, 3e-3);
  EXPECT_LT(e.rotation_rad, 0.05 * kDeg);
  EXPECT_NEAR(fit->report.position_rms_m, 0.002 * std::sqrt(3), 0.0002);
  EXPECT_NEAR(fit->report.rotation_rms_rad, 0.2 * kDeg * std::sqrt(3), 0.02 * kDeg);
}

TEST(MotionFit, FindsHowTheTruthIsMounted) {
  Recording recording;
  recording.tilt = Vec3(0.02, -0.01, 0);
  recording.mount = Vec3(0.03, -0.05, 0.02);
  recording.p_BM = Vec3(0.04, -0.02, 0.03);
  recording.time_offset_s = 0.007;
  const Case c(recording);
  const auto fit = c.fit(trusting(recording));
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_LT((fit->report.mount_rad - recording.mount).norm(), 0.05 * kDeg);
  EXPECT_LT((fit->report.p_BM - recording.p_BM).norm(), 1e-3);
  EXPECT_NEAR(fit->report.time_offset_s, 0.007, 1e-4);
  EXPECT_NEAR(fit->report.tilt_rad, recording.tilt.norm(), 0.05 * kDeg);
  const Errors e = errors(fit->motion, c.flight);
  EXPECT_LT(e.position_m, 2e-3);
  EXPECT_LT(e.tilt_rad, 0.05 * kDeg);
}

TEST(MotionFit, BridgesTwoSecondsAndLeavesOutliersOut) {
  Recording recording;
  recording.gap_begin_s = 9;
  recording.gap_end_s = 11;
  recording.outlier_share = 0.02;
  const Case c(recording);
  const auto fit = c.fit(trusting(recording));
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_NEAR(fit->report.longest_gap_s, 2, 0.05);
  EXPECT_NEAR(fit->report.distrusted_share, 0.02, 0.01);
  EXPECT_LT(errors(fit->motion, c.flight).position_m, 2e-3);
}

TEST(MotionFit, FindsTheBiases) {
  const Recording recording;
  const Case c(recording);
  const auto fit = c.fit(trusting(recording));
  ASSERT_TRUE(fit);
  ImuSimulator simulator({}, Random(1, 1));
  double g2 = 0, a2 = 0, n = 0;
  for (double t = 0; t < kLength_s; t += 0.005) {
    const double s = fit->motion.seconds(kBegin + Span::from_seconds(t));
    if (s > 0 && s < fit->motion.duration_s()) {
      g2 += (fit->motion.gyroscope_bias(s) - simulator.gyroscope_bias()).squaredNorm();
      a2 += (fit->motion.accelerometer_bias(s) - simulator.accelerometer_bias()).squaredNorm();
      n += 3;
    }
    simulator.read({}, c.flight.at(t));
  }
  // what they walk in some seconds: 1.9e-5 and 3e-3 per root of a second
  EXPECT_LT(std::sqrt(g2 / n), 1e-4);
  EXPECT_LT(std::sqrt(a2 / n), 1e-2);
}

// The most probable motion takes noise for motion; a drawn one is as far from the readings as the true one.
TEST(MotionFit, ADrawDisagreesWithTheImuAsItsNoiseDoes) {
  const Recording recording;
  double most_probable = 0, drawn = 0;
  constexpr int kFlights = 3;
  for (std::uint64_t seed = 1; seed <= kFlights; ++seed) {
    const Case c(recording, seed);
    FitSettings settings = trusting(recording);
    const auto fit = c.fit(settings);
    settings.draw = seed;
    const auto draw = c.fit(settings);
    ASSERT_TRUE(fit && draw);
    most_probable += fit->report.integrated[1].nees / kFlights;
    drawn += draw->report.integrated[1].nees / kFlights;
    EXPECT_NEAR(draw->report.samples.gyroscope.rms / draw->report.samples.gyroscope.predicted, 1, 0.02);
    EXPECT_GT((draw->motion.at(5).p_WB - fit->motion.at(5).p_WB).norm(), 1e-5);
  }
  EXPECT_LT(most_probable, 0.7);
  EXPECT_NEAR(drawn, 0.92, 0.1);  // below 1: within a second the fitted biases do not walk
}

TEST(MotionFit, IsTheSameEveryTime) {
  const Case c(Recording{});
  FitSettings settings;
  settings.draw = 3;
  const auto a = c.fit(settings), b = c.fit(settings);
  ASSERT_TRUE(a && b);
  for (double t = 0; t < a->motion.duration_s(); t += 0.77) {
    EXPECT_EQ(a->motion.at(t).p_WB, b->motion.at(t).p_WB);
    EXPECT_EQ(a->motion.at(t).R_WB, b->motion.at(t).R_WB);
  }
}

TEST(MotionFit, ReportsInWordsAndInJson) {
  const auto fit = Case(Recording{}).fit();
  ASSERT_TRUE(fit);
  EXPECT_THAT(text_of(fit->report), testing::HasSubstr("IMU integrated over 0.5 s"));
  const auto json = nlohmann::json::parse(json_of(fit->report));
  EXPECT_EQ(json["integrated"].size(), 4u);
  EXPECT_DOUBLE_EQ(json["truth"]["position_rms_m"].get<double>(), fit->report.position_rms_m);
}

// Motion capture drops out for two seconds here.
TEST(MotionFit, AgreesWithARecordedImu) {
#ifdef EPILINE_SANITIZED
  GTEST_SKIP() << "minutes of flight; the simulated ones take the same ways";
#endif
  const std::filesystem::path folder = test::recorded_data("imu_only/tumvi_room3");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const auto flight = open_asl_motion(folder);
  ASSERT_TRUE(flight && flight->ground_truth);
  FitSettings settings;
  settings.draw = 1;
  const auto fit = fit_motion(flight->imu_samples, flight->imu.noise, *flight->ground_truth, settings);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_GT(fit->report.longest_gap_s, 1.9);
  EXPECT_LT(fit->report.position_rms_m, 0.03);
  for (const IntegratedAgreement& a : fit->report.integrated) {
    EXPECT_GT(a.nees, 0.8) << a.interval_s;
    EXPECT_LT(a.nees, a.interval_s > 1 ? 2.5 : 1.7) << a.interval_s;
  }
}

TEST(MotionFit, RefusesWhatIsNoFlight) {
  const std::string no_pose = " no position or no unit quaternion; expected finite numbers, |q| = 1";
  struct Refusal {
    std::string text;
    std::function<void(Case&)> spoil;
  };
  for (const auto& [text, spoil] : {
           Refusal{"imu.csv: at 1000.500000000 s a reading that is not finite; expected six numbers",
                   [](Case& c) { c.imu[100].specific_force_m_s2[1] = std::numeric_limits<double>::quiet_NaN(); }},
           Refusal{"imu.csv: at 1000.500000000 s a reading out of order or doubled; expected rising stamps",
                   [](Case& c) { std::swap(c.imu[100], c.imu[101]); }},
           Refusal{"imu.csv: at 1000.500000000 s no reading for 0.055 s; expected one every 0.005 s",
                   [](Case& c) { c.imu.erase(c.imu.begin() + 101, c.imu.begin() + 111); }},
           Refusal{"truth.csv: 0.000 s in common with imu.csv; expected 5.000 s at least",
                   [](Case& c) { c.imu.clear(); }},
           Refusal{"no pose for 4.010 s; expected gaps up to 3 s",
                   [](Case& c) { c.truth.poses.erase(c.truth.poses.begin() + 1000, c.truth.poses.begin() + 1400); }},
           Refusal{"truth.csv: at 1000.600000000 s" + no_pose,
                   [](Case& c) { c.truth.poses[50].q_WB.coeffs() *= 1.01; }},
           Refusal{"truth.csv: 2.290 s in common with imu.csv; expected 5.000 s at least",
                   [](Case& c) {
                     for (TimedPose& pose : c.truth.poses) pose.stamp = pose.stamp + Span::from_seconds(17.6);
                   }},
           Refusal{"truth.csv: at 1004.000000000 s" + no_pose,
                   [](Case& c) {  // as a file's reader tells it
                     c.truth.worst_norm_error = 0.01;
                     c.truth.worst_norm_at = HostStamp{1'004'000'000'000};
                   }},
       }) {
    Case c{Recording{}};
    spoil(c);
    FitSettings settings;
    settings.imu_name = "imu.csv";
    settings.truth_name = "truth.csv";
    const auto fit = c.fit(settings);
    ASSERT_FALSE(fit) << text;
    EXPECT_THAT(fit.error().text(), testing::HasSubstr(text));
  }
}

}  // namespace
}  // namespace epiline
