// A few simulated flights of each kind: does the covariance tell the truth, and does anything diverge?
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

struct Nees {
  double position = 0, rotation = 0;
};

/// Mean over runs with the seeds 1, 2, ...; complains about runs that diverge.
Nees mean_nees(FlightKind flight, const TrackNoise& noise, int runs) {
  Nees nees;
  for (int run = 1; run <= runs; ++run) {
    TrackSimulation simulation;
    simulation.flight = flight;
    simulation.seed = static_cast<std::uint64_t>(run);
    simulation.noise = noise;
    const RunFigures figures = run_simulated(simulate_tracks(simulation), known_config(simulation), simulation.seed);
    EXPECT_FALSE(figures.diverged) << "seed " << run << ", at " << figures.diverged_at_s << " s";
    nees.position += figures.nees_position / runs;
    nees.rotation += figures.nees_rotation / runs;
  }
  return nees;
}

// The band is [0.5, 2]; errors of one flight are so correlated that four runs are worth about 40 independent
// coordinates: their mean has a relative standard deviation of 22 %.
constexpr int kRuns = 4;
constexpr double kLow = 0.5 * (1 - 0.22), kHigh = 2 * (1 + 0.22);

class EstimatorOnFlight : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, EstimatorOnFlight,
                         testing::Values(FlightKind::kAgile, FlightKind::kHover, FlightKind::kStraight,
                                         FlightKind::kStandstill),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST_P(EstimatorOnFlight, IsConsistentAndStaysOnCourse) {
  const Nees nees = mean_nees(GetParam(), {.pixel_sigma = 1, .outlier_share = 0.02}, kRuns);
  EXPECT_GT(nees.position, kLow);
  EXPECT_LT(nees.position, kHigh);
  EXPECT_GT(nees.rotation, kLow);
  EXPECT_LT(nees.rotation, kHigh);
}

// Sharp tracks make large numbers: an information matrix that 1 px forgives is singular here.
TEST_P(EstimatorOnFlight, IsConsistentWithSharpTracks) {
  const Nees nees = mean_nees(GetParam(), {.pixel_sigma = 0.3}, kRuns);
  EXPECT_GT(nees.position, kLow);
  EXPECT_LT(nees.position, kHigh);
  EXPECT_GT(nees.rotation, kLow);
  EXPECT_LT(nees.rotation, kHigh);
}

}  // namespace
}  // namespace epiline
