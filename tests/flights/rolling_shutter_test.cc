// Whole flights with a rolling shutter that is simulated exactly. Derivation: docs/derivations/rolling_shutter.md.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "tests/flights/simulated_run.h"

namespace epiline {
namespace {

constexpr int kSeeds = 3;
constexpr double kReadout_s = 0.033;  // the slowest of common sensors

struct ShutterErrors {
  double ate_m = 0, nees_position = 0, nees_rotation = 0;  // means over the runs
};

ShutterErrors errors_of(FlightKind flight, double readout_s, bool known) {
  ShutterErrors mean;
  for (int run = 1; run <= kSeeds; ++run) {
    TrackSimulation simulation;
    simulation.flight = flight;
    simulation.seed = static_cast<std::uint64_t>(run);
    simulation.noise = {.pixel_sigma = 0.3};
    simulation.readout_s = readout_s;
    EstimatorConfig config = known_config(simulation);
    if (!known) config.extrinsics.readout_s = 0;
    const RunFigures figures = run_simulated(simulate_tracks(simulation), config, simulation.seed);
    EXPECT_TRUE(!known || !figures.diverged) << "seed " << run << ", at " << figures.diverged_at_s << " s";
    mean.ate_m += figures.ate_m / kSeeds;
    mean.nees_position += figures.nees_position / kSeeds;
    mean.nees_rotation += figures.nees_rotation / kSeeds;
  }
  return mean;
}

class RollingShutter : public testing::TestWithParam<FlightKind> {};

INSTANTIATE_TEST_SUITE_P(Flights, RollingShutter, testing::Values(FlightKind::kAgile, FlightKind::kHall),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST_P(RollingShutter, CostsNextToNothingWhereItIsKnownAndMuchWhereItIsNot) {
  const ShutterErrors global = errors_of(GetParam(), 0, true), rolling = errors_of(GetParam(), kReadout_s, true);
  EXPECT_LT(rolling.ate_m, 1.25 * global.ate_m);  // three runs scatter by a tenth
  for (const double nees : {rolling.nees_position, rolling.nees_rotation}) {
    EXPECT_GT(nees, 0.4);
    EXPECT_LT(nees, 2.4);
  }
  EXPECT_GT(errors_of(GetParam(), kReadout_s, false).ate_m, 2 * rolling.ate_m);
}

}  // namespace
}  // namespace epiline
