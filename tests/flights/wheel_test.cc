// What the speed of the wheels gains. Derivation: docs/derivations/wheel.md
#include <gtest/gtest.h>

#include <string>

#include "drivers/laboratory/simulate/wheel_simulator.h"
#include "tests/flights/tracked_flight.h"

namespace epiline {
namespace {

using test::ate;
using WheelOutcome = test::TrackedOutcome;

class Wheels : public test::TrackedFlight {
 protected:
  void fly(FlightKind kind, const WheelSimulation& wheel = {}) {
    TrackSimulation simulation;
    simulation.flight = kind;
    simulation.noise.pixel_sigma = 0.5;
    const SimulatedFlight flight = simulate_tracks(simulation);
    TrackedFlight::fly(simulation, flight, simulate_wheel(flight.flight, kFlightBegin, wheel, 1));
  }
};

constexpr const char* kWith = "[wheel]\nsigma_m_s = 0.05\n";
constexpr const char* kWithout = "[wheel]\nuse = false\n";

// A vehicle at a constant speed: the accelerometer has nothing to say about the scale. It looks to its left.
TEST_F(Wheels, HoldTheScaleOfAStraightWay) {
  fly(FlightKind::kStraight, {.forward_B = -Vec3::UnitY()});
  const std::string settings = "[body]\nyaw_pitch_roll_deg = [90, 0, 0]\n";
  const WheelOutcome with = replayed(settings + kWith), without = replayed(settings + kWithout);
  EXPECT_GT(with.stats.wheel_frames, 300u);
  EXPECT_EQ(with.stats.wheel_slips, 0u);
  EXPECT_EQ(without.stats.wheel_frames, 0u);
  EXPECT_LT(ate(with), 0.8 * ate(without));
}

// Ten thousand noisy readings do not make a wrong radius right, and do not shrink the scale either.
TEST_F(Wheels, OfAWrongRadiusAreBelievedAsFarAsTheyMayBe) {
  const std::string settings = "[body]\nyaw_pitch_roll_deg = [90, 0, 0]\n[wheel]\nsigma_m_s = 0.02\n";
  fly(FlightKind::kStraight, {.forward_B = -Vec3::UnitY(), .scale_error = 0.1});
  const WheelOutcome wrong = replayed(settings), without = replayed(kWithout);
  EXPECT_LT(ate(wrong), 3 * ate(without));
  const Suspicion& said = wrong.stats.suspicions[static_cast<std::size_t>(Suspect::kWheelScale)];
  EXPECT_EQ(said.severity, Severity::kNote);
  EXPECT_NEAR(said.figure, 1 / 1.1, 0.05);
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
  std::filesystem::remove_all(folder_ / "mav0/wheel0");
  const WheelOutcome none = replayed(kWith);
  EXPECT_FALSE(none.path.empty());
  EXPECT_EQ(none.path, left_out.path);
}

TEST_F(Wheels, ReachTheEstimatorInThreadsAndTheFlightRecorder) {
  fly(FlightKind::kRover);
  records_ = folder_ / "records";
  const WheelOutcome flown = replayed(kWith, 2.0, 10);
  EXPECT_GT(flown.stats.wheel_samples, 300u);
  EXPECT_GT(flown.stats.wheel_frames, 30u);
  const WheelOutcome again = replayed_record();
  EXPECT_GE(again.stats.wheel_samples, flown.stats.wheel_samples - 10) << "a tenth of a second of the end";
  EXPECT_GT(again.stats.wheel_frames, 30u);
}

}  // namespace
}  // namespace epiline
