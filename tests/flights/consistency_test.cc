// A few simulated flights of each kind: does the covariance tell the truth, and does anything diverge?
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

// The band is [0.5, 2]; errors of one flight are so correlated that four runs are worth about 40 independent
// coordinates: their mean has a relative standard deviation of 22 %. A rest is one error for as long as it lasts.
constexpr int kRuns = 4, kRunsWithRests = 16;

class EstimatorOnFlight : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, EstimatorOnFlight,
                         testing::Values(FlightKind::kAgile, FlightKind::kHover, FlightKind::kStraight,
                                         FlightKind::kStandstill),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

// Sharp tracks make large numbers: an information matrix that 1 px forgives is singular there.
TEST_P(EstimatorOnFlight, IsConsistentAndStaysOnCourse) {
  for (const TrackNoise& noise :
       {TrackNoise{.pixel_sigma = 1, .outlier_share = 0.02}, TrackNoise{.pixel_sigma = 0.3}}) {
    TrackSimulation simulation;
    simulation.flight = GetParam();
    simulation.noise = noise;
    const int runs = GetParam() == FlightKind::kStandstill ? kRunsWithRests : kRuns;
    const double deviation = 0.22 * std::sqrt(1. * kRuns / runs);
    const RunFigures mean = mean_of_runs(simulation, runs);
    EXPECT_FALSE(mean.diverged) << "at " << mean.diverged_at_s << " s";
    for (const double nees : {mean.nees_position, mean.nees_rotation}) {
      EXPECT_GT(nees, 0.5 * (1 - deviation)) << noise.pixel_sigma << " px";
      EXPECT_LT(nees, 2 * (1 + deviation)) << noise.pixel_sigma << " px";
    }
  }
}

}  // namespace
}  // namespace epiline
