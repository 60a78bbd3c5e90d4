// What the speed of the wheels gains. Derivation: docs/derivations/wheel.md
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <optional>
#include <string>

#include "drivers/flights/simulate/asl_writer.h"
#include "drivers/flights/simulate/wheel_simulator.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/text/table.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

struct WheelOutcome {
  TrajectoryErrors errors;
  EstimatorStats stats;
  std::string path;  ///< as the trajectory file has it
};

/// A flight of tracks from its very beginning, wheels included.
class Wheels : public testing::Test {
 protected:
  void fly(FlightKind kind, const WheelSimulation& wheel = {}) {
    TrackSimulation simulation;
    simulation.flight = kind;
    simulation.noise.pixel_sigma = 0.5;
    const SimulatedFlight flight = simulate_tracks(simulation);
    fs::remove_all(folder_);
    ASSERT_TRUE(write_asl(simulation, flight, folder_, simulate_wheel(flight.flight, kFlightBegin, wheel, 1)));
  }
  void TearDown() override { fs::remove_all(folder_); }

  WheelOutcome replayed(const std::string& settings, std::optional<double> speed = std::nullopt,
                        double duration_s = std::numeric_limits<double>::infinity()) {
    const fs::path config = folder_ / "config.toml";
    EXPECT_TRUE(write_text(config, settings));
    ReplayOptions options;
    options.dataset = folder_;
    options.config_file = config;
    options.duration_s = duration_s;
    options.realtime_speed = speed;
    options.record_folder = records_;
    auto result = replay(options, [](std::size_t, std::size_t) {});
    if (!result || !result->record.truth) {
      ADD_FAILURE() << (result ? "no truth" : result.error().text());
      return {};
    }
    const Trajectory trajectory = trajectory_of(result->record);
    return {evaluate(trajectory, *result->record.truth), result->record.estimator, tum_text(trajectory)};
  }

  fs::path records_;  ///< of the flight recorder; empty: none
  fs::path folder_ = fs::path(testing::TempDir()) /
                     (std::string("epiline_wheels_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

constexpr const char* kWith = "[wheel]\nsigma_m_s = 0.05\n";
constexpr const char* kWithout = "[wheel]\nuse = false\n";

double ate(const WheelOutcome& o) { return o.errors.ate_4dof.rmse; }

// A vehicle at a constant speed: the accelerometer has nothing to say about the scale.
TEST_F(Wheels, HoldTheScaleOfAStraightWay) {
  fly(FlightKind::kStraight);
  const WheelOutcome with = replayed("[wheel]\nsigma_m_s = 0.02\n"), without = replayed(kWithout);
  EXPECT_GT(with.stats.wheel_frames, 300u);
  EXPECT_EQ(without.stats.wheel_frames, 0u);
  EXPECT_LT(ate(with), 0.8 * ate(without));
}

TEST_F(Wheels, DoNoHarmOnARoverWithVision) {
  fly(FlightKind::kRover);
  const WheelOutcome with = replayed(kWith), without = replayed(kWithout);
  EXPECT_LT(ate(with), 1.1 * ate(without));
  EXPECT_LT(ate(with), 0.03);
}

// Wheels that stand while the vehicle moves, as on ice.
TEST_F(Wheels, ThatAreLockedAreNotBelieved) {
  fly(FlightKind::kRover, {.scale_error = -1});
  EXPECT_LT(ate(replayed(kWith)), 0.05);
}

TEST_F(Wheels, ThatAreLeftOutChangeNotABit) {
  fly(FlightKind::kRover);
  const WheelOutcome left_out = replayed(kWithout);
  fs::remove_all(folder_ / "mav0/wheel0");
  const WheelOutcome none = replayed(kWith);
  EXPECT_FALSE(none.path.empty());
  EXPECT_EQ(none.path, left_out.path);
}

TEST_F(Wheels, ReachTheEstimatorInThreads) {
  fly(FlightKind::kRover);
  const WheelOutcome threads = replayed(kWith, 2.0, 10);
  EXPECT_GT(threads.stats.wheel_samples, 300u);
  EXPECT_GT(threads.stats.wheel_frames, 30u);
}

TEST_F(Wheels, AreInTheFlightRecordersRecordAndReplayedFromIt) {
  fly(FlightKind::kRover);
  records_ = folder_ / "records";
  const WheelOutcome flown = replayed(kWith, 2.0, 10);
  const fs::path record = records_ / "record-001-end";
  ReplayOptions options;
  options.dataset = record;
  options.config_file = record / "config.toml";
  const auto again = replay(options, [](std::size_t, std::size_t) {});
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_GE(again->record.estimator.wheel_samples, flown.stats.wheel_samples - 10) << "a tenth of a second of the end";
  EXPECT_GT(again->record.estimator.wheel_frames, 30u);
}

}  // namespace
}  // namespace epiline
