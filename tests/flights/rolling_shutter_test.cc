// Whole flights with a rolling shutter that is simulated exactly. Derivation: docs/derivations/rolling_shutter.md.
#include <gtest/gtest.h>

#include <string>

#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

class RollingShutter : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, RollingShutter, testing::Values(FlightKind::kAgile, FlightKind::kHall),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST_P(RollingShutter, CostsNextToNothingWhereItIsKnownAndMuchWhereItIsNot) {
  constexpr int kSeeds = 3;
  TrackSimulation simulation;
  simulation.flight = GetParam();
  simulation.noise = {.pixel_sigma = 0.3};
  const RunFigures global = mean_of_runs(simulation, kSeeds);
  simulation.readout_s = 0.033;  // the slowest of common sensors
  const RunFigures rolling = mean_of_runs(simulation, kSeeds);
  EXPECT_FALSE(global.diverged || rolling.diverged);
  EXPECT_LT(rolling.ate_m, 1.25 * global.ate_m);  // three runs scatter by a tenth
  for (const double nees : {rolling.nees_position, rolling.nees_rotation}) {
    EXPECT_GT(nees, 0.4);
    EXPECT_LT(nees, 2.4);
  }
  const RunFigures unknown = mean_of_runs(simulation, kSeeds, [](EstimatorConfig& c) { c.extrinsics.readout_s = 0; });
  EXPECT_GT(unknown.ate_m, 2 * rolling.ate_m);
}

}  // namespace
}  // namespace epiline
