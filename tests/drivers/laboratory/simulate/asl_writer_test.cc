#include "drivers/laboratory/simulate/asl_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/laboratory/simulate/height_simulator.h"
#include "drivers/laboratory/simulate/wheel_simulator.h"

namespace epiline {
namespace {

class AslWriter : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              ("asl_writer_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::remove_all(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

// What the reader makes of the written folder is the flight that was simulated.
TEST_F(AslWriter, AReplayReadsBackWhatWasSimulated) {
  TrackSimulation simulation;
  simulation.flight = FlightKind::kAgile;
  simulation.time_offset_s = 0;
  const SimulatedFlight flight = simulate_tracks(simulation);
  ASSERT_TRUE(write_asl(simulation, flight, folder_));
  const Result<AslDataset> read = open_asl_dataset(folder_, "cam0");
  ASSERT_TRUE(read) << read.error().text();

  ASSERT_EQ(read->imu_samples.size(), flight.imu.size());
  for (std::size_t i = 0; i < flight.imu.size(); ++i) {
    ASSERT_EQ(read->imu_samples[i].stamp, flight.imu[i].stamp);
    ASSERT_EQ(read->imu_samples[i].angular_velocity_rad_s, flight.imu[i].angular_velocity_rad_s);
    ASSERT_EQ(read->imu_samples[i].specific_force_m_s2, flight.imu[i].specific_force_m_s2);
  }
  ASSERT_EQ(read->points.size(), flight.observations.size());
  ASSERT_EQ(read->instants.size(), flight.images.size());
  for (std::size_t i = 0; i < flight.images.size(); ++i) {
    const SimulatedImage& image = flight.images[i];
    ASSERT_EQ(read->instants[i].stamp, image.stamp);
    ASSERT_EQ(read->instants[i].count, image.end - image.begin);
    for (std::size_t k = 0; k < read->instants[i].count; ++k) {
      const TrackPoint& point = read->points[read->instants[i].first + k];
      const TrackObservation& truth = flight.observations[image.begin + k];
      ASSERT_EQ(point.id, truth.id);
      ASSERT_NEAR(point.u, truth.pixel.x(), 1e-4);
      ASSERT_NEAR(point.v, truth.pixel.y(), 1e-4);
    }
  }
  EXPECT_TRUE(read->height_samples.empty() && read->wheel_samples.empty());
  EXPECT_EQ(read->camera.parameters.width, flight.width);
  EXPECT_TRUE(read->camera.R_BC.isApprox(flight.extrinsics.R_BC, 1e-12));
  EXPECT_TRUE(read->camera.p_BC.isApprox(flight.extrinsics.p_BC, 1e-12));
  EXPECT_EQ(read->imu.noise.gyroscope_density, simulation.imu.noise.gyroscope_density);
  ASSERT_TRUE(read->ground_truth);
  ASSERT_EQ(read->ground_truth->poses.size(), flight.images.size());
  for (std::size_t i = 0; i < flight.images.size(); ++i) {
    const TimedPose& pose = read->ground_truth->poses[i];
    ASSERT_EQ(pose.stamp, flight.images[i].stamp_true);
    ASSERT_TRUE(pose.p_WB.isApprox(flight.images[i].truth.p_WB, 1e-12));
    ASSERT_TRUE(pose.q_WB.toRotationMatrix().isApprox(flight.images[i].truth.R_WB, 1e-9));
  }
}

TEST_F(AslWriter, WheelsAndHeightsAreReadBackInTheOrderOfTime) {
  const TrackSimulation simulation;
  const SimulatedFlight flight = simulate_tracks(simulation);
  const auto wheel = simulate_wheel(flight.flight, kFlightBegin, {}, 1);
  std::vector<HeightSample> heights = simulate_barometer(flight.flight, kFlightBegin, {}, 1);
  ASSERT_TRUE(write_asl(simulation, flight, folder_ / "barometer", wheel, heights));
  const auto one = open_asl_dataset(folder_ / "barometer", "cam0");
  ASSERT_TRUE(one) << one.error().text();
  const auto same = [](const auto& a, const auto& b) { return a.stamp == b.stamp; };
  EXPECT_TRUE(std::ranges::equal(one->wheel_samples, wheel, same));
  EXPECT_TRUE(std::ranges::equal(one->height_samples, heights, [](const HeightSample& a, const HeightSample& b) {
    return a.stamp == b.stamp && a.metres == b.metres;
  }));
  const auto range = simulate_range(flight.flight, kFlightBegin, flat_ground(-1.5), {}, 1);
  heights.insert(heights.end(), range.begin(), range.end());
  ASSERT_TRUE(write_asl(simulation, flight, folder_ / "both", wheel, heights));
  const auto both = open_asl_dataset(folder_ / "both", "cam0");
  ASSERT_TRUE(both) << both.error().text();
  std::stable_sort(heights.begin(), heights.end(), [](auto& a, auto& b) { return a.stamp < b.stamp; });
  EXPECT_TRUE(std::ranges::equal(both->height_samples, heights, same));
}

TEST_F(AslWriter, SaysWhereItCannotWrite) {
  std::ofstream(folder_) << "a file where a folder should be\n";
  const SimulatedFlight empty;
  const Status status = write_asl({}, empty, folder_);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().kind, ErrorKind::kUsage);
  EXPECT_NE(status.error().text().find(folder_.string()), std::string::npos);
}

}  // namespace
}  // namespace epiline
