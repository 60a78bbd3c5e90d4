// Camera or IMU silent in a simulated flight of tracks: what the new start is off is small, and claimed.
// tests/flights/silence.cc does the same to rendered flights.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/laboratory/simulate/asl_writer.h"
#include "drivers/laboratory/simulate/track_simulator.h"
#include "tests/flights/silence_run.h"

namespace epiline {
namespace {

constexpr double kSigmas = 3.5;

class Silences : public testing::Test {
 protected:
  void SetUp() override {
    TrackSimulation simulation;
    simulation.flight = FlightKind::kAgile;
    simulation.noise = {.pixel_sigma = 0.5, .drift_px = 0.1};
    const SimulatedFlight flight = simulate_tracks(simulation);
    ASSERT_TRUE(write_asl(simulation, flight, folder_));
    options_.dataset = folder_;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::vector<test::SilenceVerdict> fly(const std::vector<test::Silence>& silences) {
    options_.duration_s = silences.back().from_s + silences.back().duration_s + 4;
    const auto verdicts = test::fly_with_silences(options_, silences);
    EXPECT_EQ(verdicts.size(), silences.size());
    return verdicts;
  }

  static void expect_covered(const test::SilenceVerdict& v) {
    ASSERT_TRUE(v.judged);
    EXPECT_LT(v.position_error_m, kSigmas * v.position_sigma_m + 0.002);
    EXPECT_LT(v.heading_error_deg, kSigmas * v.heading_sigma_deg + 0.01);
  }

  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) / ("epiline_silences_" + std::to_string(getpid()));
  ReplayOptions options_;
};

TEST_F(Silences, OfTheCameraAreBridgedByTheImuWhoseErrorIsClaimed) {
  for (const double shortest_s : {1., 2.}) {
    std::vector<test::Silence> silences;
    double t = 7 + shortest_s;
    for (const double seconds : {shortest_s, 3., 5.}) {
      silences.push_back({false, t, seconds});
      t += seconds + 6;
    }
    for (const test::SilenceVerdict& v : fly(silences)) {
      SCOPED_TRACE(testing::Message() << v.silence.duration_s << " s at " << v.silence.from_s << " s");
      expect_covered(v);
      EXPECT_FALSE(v.reset);
      EXPECT_LT(v.first_pose_s, 0.1);
      EXPECT_LT(v.position_error_m, v.silence.duration_s < 4 ? 0.5 : 1.5);
      EXPECT_LT(v.heading_error_deg, v.silence.duration_s < 4 ? 1 : 2);
      EXPECT_LT(v.position_sigma_m, 0.5) << "claims next to nothing";
      EXPECT_NE(v.state, HealthState::kTracking);
      EXPECT_GE(v.tracking_s, 0);
    }
  }
}

TEST_F(Silences, OfTheImuAreBridgedByTheImages) {
  for (const double seconds : {1., 2., 5.}) {
    SCOPED_TRACE(testing::Message() << seconds << " s");
    const auto verdicts = fly({{true, 12.3, seconds}});
    ASSERT_EQ(verdicts.size(), 1U);
    expect_covered(verdicts[0]);
    EXPECT_FALSE(verdicts[0].reset);
    EXPECT_LT(verdicts[0].first_pose_s, 0.2);
    EXPECT_LT(verdicts[0].position_error_m, 0.1 * seconds);
    EXPECT_LT(verdicts[0].heading_error_deg, 1);
    EXPECT_LT(verdicts[0].position_sigma_m, 0.1 * seconds) << "claims next to nothing";
    EXPECT_NE(verdicts[0].state, HealthState::kTracking);
    EXPECT_GE(verdicts[0].tracking_s, 0);
    EXPECT_LT(verdicts[0].tracking_s, 2);
  }
}

}  // namespace
}  // namespace epiline
