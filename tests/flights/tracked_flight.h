#pragma once
// A simulated flight of tracks with other sensors beside, replayed under several settings.
#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "drivers/laboratory/simulate/asl_writer.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/text/table.h"

namespace epiline::test {

struct TrackedOutcome {
  TrajectoryErrors errors;
  EstimatorStats stats;
  std::string path;  ///< as the trajectory file has it
};

inline double ate(const TrackedOutcome& o) { return o.errors.ate_4dof.rmse; }

class TrackedFlight : public testing::Test {
 protected:
  /// Writes the flight into `folder_`.
  void fly(const TrackSimulation& simulation, const SimulatedFlight& flight, const std::vector<WheelSample>& wheel,
           const std::vector<HeightSample>& heights = {}) {
    std::filesystem::remove_all(folder_);
    ASSERT_TRUE(write_asl(simulation, flight, folder_, wheel, heights));
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  TrackedOutcome replayed(const std::string& settings, std::optional<double> speed = std::nullopt,
                          double duration_s = std::numeric_limits<double>::infinity()) {
    const std::filesystem::path config = folder_ / "config.toml";
    EXPECT_TRUE(write_text(config, settings));
    ReplayOptions options;
    options.dataset = folder_;
    options.config_file = config;
    options.duration_s = duration_s;
    options.realtime_speed = speed;
    options.record_folder = records_;
    return outcome(options);
  }

  /// What the flight recorder wrote at the end of the last replay, replayed.
  TrackedOutcome replayed_record() {
    const std::filesystem::path record = records_ / "record-001-end";
    ReplayOptions options;
    options.dataset = record;
    options.config_file = record / "config.toml";
    return outcome(options);
  }

  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) / folder_name();
  std::filesystem::path records_;  ///< of the flight recorder; empty: none

 private:
  static std::string folder_name() {
    const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
    return std::string("epiline_") + test.test_suite_name() + "_" + test.name();
  }
  static TrackedOutcome outcome(const ReplayOptions& options) {
    auto result = replay(options, [](std::size_t, std::size_t) {});
    if (!result) {
      ADD_FAILURE() << result.error().text();
      return {};
    }
    const Trajectory trajectory = trajectory_of(result->record);
    TrackedOutcome o{{}, result->record.estimator, tum_text(trajectory)};
    if (result->record.truth) o.errors = evaluate(trajectory, *result->record.truth);
    return o;
  }
};

}  // namespace epiline::test
