// A small Monte-Carlo study: does the covariance tell the truth, and does anything diverge?
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

class EstimatorOnFlight : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, EstimatorOnFlight,
                         testing::Values(FlightKind::kAgile, FlightKind::kHover, FlightKind::kStraight),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST_P(EstimatorOnFlight, IsConsistentAndStaysOnCourse) {
  constexpr int kRuns = 4;
  double nees_position = 0, nees_rotation = 0;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    TrackSimulation simulation;
    simulation.flight = GetParam();
    simulation.seed = seed;
    simulation.noise = {.pixel_sigma = 1, .outlier_share = 0.02};
    const RunFigures figures =
        run_simulated(simulate_tracks(simulation), comparison_config(VisualFactor::kTrack, simulation), seed);
    EXPECT_FALSE(figures.diverged) << "seed " << seed << ", at " << figures.diverged_at_s << " s";
    nees_position += figures.nees_position / kRuns;
    nees_rotation += figures.nees_rotation / kRuns;
  }
  // The band is [0.5, 2]; errors of one flight are so correlated that four runs are worth about 40 independent
  // coordinates: their mean has a relative standard deviation of 22 %.
  constexpr double kLow = 0.5 * (1 - 0.22), kHigh = 2 * (1 + 0.22);
  EXPECT_GT(nees_position, kLow);
  EXPECT_LT(nees_position, kHigh);
  EXPECT_GT(nees_rotation, kLow);
  EXPECT_LT(nees_rotation, kHigh);
}

}  // namespace
}  // namespace epiline
