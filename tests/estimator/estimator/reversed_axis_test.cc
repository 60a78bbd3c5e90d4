// An axis of the accelerometer with the wrong sign, through the whole estimator. Images and gyroscope agree then, and
// no turn shows it. docs/derivations/turns.md, "Contradictions".
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

struct Reversed {
  const char* name;
  int axis;
  double moving_from;   ///< s; negative: it starts in motion
  double motion, pace;  ///< of the path
  double most_trusted_s;
};
void PrintTo(const Reversed& r, std::ostream* out) { *out << r.name; }

class ReversedAxis : public testing::TestWithParam<Reversed> {};

/// Tracks as exact as those of a good camera: they fit a wrong sign for long.
TEST_P(ReversedAxis, IsNamedAndNotTrustedForLong) {
  const Reversed& wrong = GetParam();
  Rig rig({.moving_from = wrong.moving_from, .path = {wrong.motion}, .pace = wrong.pace}, {});
  rig.most_features = 150;
  rig.pixel_noise = 0.05;
  rig.force_signs[wrong.axis] = -1;
  double trusted_s = 0;
  rig.run_to(std::max(0.0, wrong.moving_from) + 20, [&] {
    const bool off = rig.velocity_error() > 3.5 * std::sqrt(3) * rig.sigma_velocity();
    if (off && rig.odometry().health.state == HealthState::kTracking) trusted_s += 0.05;
  });
  EXPECT_LT(trusted_s, wrong.most_trusted_s);
  EXPECT_TRUE(std::any_of(rig.stats().suspicions.begin(), rig.stats().suspicions.end(),
                          [](const Suspicion& s) { return s.severity > Severity::kNote; }));
}

// With the tracks' misfit alone 8.5, 3.1, 3.2, 0.85 s, and the last one unnamed.
INSTANTIATE_TEST_SUITE_P(Flights, ReversedAxis,
                         testing::Values(Reversed{"z_from_rest_crawling", 2, 2, 0.2, 0.2, 2},
                                         Reversed{"z_from_rest", 2, 2, 0.5, 0.2, 1.5},
                                         Reversed{"x_in_motion", 0, -2, 0.5, 0.7, 2.5},
                                         Reversed{"x_from_rest_fast", 0, 2, 1, 0.7, 0.6},
                                         Reversed{"y_in_motion", 1, -2, 1, 0.4, 0.1}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace epiline::test
