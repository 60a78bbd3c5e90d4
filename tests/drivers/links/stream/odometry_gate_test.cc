#include "drivers/links/stream/odometry_gate.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace epiline {
namespace {

using enum HealthState;

struct Step {
  std::int64_t stamp_ns;  ///< 0: nothing comes any more
  HealthState state;
  std::uint32_t resets;  ///< the estimator's own
  bool is_admitted;
  int counter;  ///< the gate's, then
};

void expect_steps(int first_counter, const std::vector<Step>& steps) {
  OdometryGate gate(static_cast<std::uint8_t>(first_counter));
  for (const Step& step : steps) {
    SCOPED_TRACE(step.stamp_ns);
    Odometry o;
    o.stamp.ns = step.stamp_ns;
    o.health.state = step.state;
    o.reset_counter = step.resets;
    if (step.stamp_ns == 0) {
      gate.stop();
    } else {
      EXPECT_EQ(gate.admits(o), step.is_admitted);
    }
    EXPECT_EQ(gate.reset_counter(), step.counter);
  }
}

// The publisher hands out the last prediction again while a sensor is silent; messages count microseconds.
TEST(OdometryGates, AdmitsWhatIsNewAndTracked) {
  expect_steps(7, {{1'000, kInitialising, 0, false, 7},
                   {2'000, kTracking, 0, true, 7},
                   {3'000, kDegraded, 0, true, 7},
                   {3'000, kDegraded, 0, false, 7},
                   {3'999, kDegraded, 0, false, 7},
                   {2'500, kTracking, 0, false, 7},
                   {4'000, kTracking, 0, true, 7}});
}

TEST(OdometryGates, CountsJumpsOnce) {
  expect_steps(255, {{1'000, kTracking, 4, true, 255},  // the first has nothing to jump from
                     {2'000, kTracking, 5, true, 0},
                     {3'000, kTracking, 5, true, 0}});
}

// After a loss, and after nobody has handed out anything for a while.
TEST(OdometryGates, ResumingIsAJump) {
  expect_steps(10, {{1'000, kInitialising, 0, false, 10},
                    {0, kLost, 0, false, 10},
                    {2'000, kTracking, 0, true, 10},  // there was nothing before
                    {3'000, kLost, 0, false, 10},
                    {4'000, kInitialising, 0, false, 10},
                    {5'000, kTracking, 0, true, 11},
                    {6'000, kLost, 0, false, 11},
                    {7'000, kTracking, 1, true, 12},  // both reasons, one jump
                    {0, kLost, 0, false, 12},
                    {8'000, kTracking, 1, true, 13},
                    {9'000, kTracking, 1, true, 13}});
}

}  // namespace
}  // namespace epiline
