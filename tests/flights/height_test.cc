// What a barometer and a range finder gain, and what they must not spoil. Derivation: docs/derivations/height.md
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "drivers/laboratory/simulate/height_simulator.h"
#include "tests/flights/tracked_flight.h"

namespace epiline {
namespace {

using test::ate;
using HeightOutcome = test::TrackedOutcome;

constexpr const char* kNone = "[height]\nbarometer = false\nrange = false\n";
constexpr const char* kBarometer = "[height]\nrange = false\n";
constexpr const char* kRange = "[height]\nbarometer = false\n";
constexpr const char* kBoth = "[height]\n";
constexpr std::size_t kBaro = 0, kBeam = 1;

/// A survey at 40 m, with a barometer and a range finder.
class Heights : public test::TrackedFlight {
 protected:
  void fly(const BarometerSimulation& barometer = {}, const RangeSimulation& range = {}) {
    TrackSimulation simulation;
    simulation.flight = FlightKind::kSurvey;
    simulation.height_m = 40;
    simulation.seed = 2;
    simulation.noise.pixel_sigma = 0.5;
    flight_ = simulate_tracks(simulation);
    auto heights = simulate_barometer(flight_.flight, kFlightBegin, barometer, 1);
    const auto distances =
        simulate_range(flight_.flight, kFlightBegin, flat_ground(flight_.flight.room().low.z()), range, 1);
    heights.insert(heights.end(), distances.begin(), distances.end());
    TrackedFlight::fly(simulation, flight_, {}, heights);
  }
  /// How far the estimated height is off at the end, after 1 km level.
  double height_error(const HeightOutcome& o) const {
    std::size_t at = o.path.rfind('\n', o.path.size() - 2);
    std::istringstream last(o.path.substr(at + 1));
    double t = 0, x = 0, y = 0, z = 0;
    last >> t >> x >> y >> z;
    return z - flight_.flight.at(t - 1e-9 * static_cast<double>(kFlightBegin.ns)).p_WB.z();
  }
  SimulatedFlight flight_;
};

TEST_F(Heights, HoldTheHeightOfALongWay) {
  fly();
  const HeightOutcome none = replayed(kNone), barometer = replayed(kBarometer), range = replayed(kRange);
  EXPECT_EQ(none.stats.height_frames[kBaro] + none.stats.height_frames[kBeam], 0u);
  EXPECT_GT(barometer.stats.height_frames[kBaro], 800u);
  EXPECT_EQ(barometer.stats.height_frames[kBeam], 0u);
  EXPECT_GT(range.stats.height_frames[kBeam], 800u);
  EXPECT_LT(std::abs(height_error(barometer)), 1.5);
  EXPECT_LT(std::abs(height_error(range)), 3);
  EXPECT_LT(std::abs(height_error(barometer)), 0.5 * std::abs(height_error(none)));
  EXPECT_LT(ate(barometer), ate(none));
  EXPECT_EQ(barometer.stats.height_jumps[kBaro], 0u);
}

TEST_F(Heights, ThatJumpAreForgottenBeforeAndBelievedAfter) {
  fly({.jump_m = 5, .jump_at_s = 60}, {.step_m = 2});
  const HeightOutcome barometer = replayed(kBarometer), both = replayed(kBoth);
  EXPECT_EQ(barometer.stats.height_jumps[kBaro], 1u);
  EXPECT_LT(std::abs(height_error(barometer)), 1.5);
  EXPECT_GT(both.stats.height_jumps[kBeam], 10u) << "of twenty steps of the ground";
  EXPECT_LT(std::abs(height_error(both)), 1.5);
  const double without = ate(replayed(kNone));
  EXPECT_LT(ate(barometer), 1.1 * without);
  EXPECT_LT(ate(both), 1.1 * without);
}

TEST_F(Heights, ThatAreLeftOutChangeNotABit) {
  fly();
  const HeightOutcome left_out = replayed(kNone, std::nullopt, 30);
  EXPECT_GT(left_out.stats.height_refused[kBaro], 500u);
  std::filesystem::remove_all(folder_ / "mav0/baro0");
  std::filesystem::remove_all(folder_ / "mav0/range0");
  const HeightOutcome none = replayed(kBoth, std::nullopt, 30);
  EXPECT_FALSE(none.path.empty());
  EXPECT_EQ(none.path, left_out.path);
}

TEST_F(Heights, ReachTheEstimatorInThreadsAndTheFlightRecorder) {
  fly();
  records_ = folder_ / "records";
  const HeightOutcome flown = replayed(kBoth, 2.0, 15);
  for (const std::size_t kind : {kBaro, kBeam}) {
    EXPECT_GT(flown.stats.height_samples[kind], 200u);
    EXPECT_GT(flown.stats.height_frames[kind], 50u);
  }
  const HeightOutcome again = replayed_record();
  for (const std::size_t kind : {kBaro, kBeam}) {
    EXPECT_GE(again.stats.height_samples[kind], flown.stats.height_samples[kind] - 10)
        << "a tenth of a second of the end";
    EXPECT_GT(again.stats.height_frames[kind], 50u);
  }
}

}  // namespace
}  // namespace epiline
