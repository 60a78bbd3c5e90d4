// The track factor on bearings of an exact rolling shutter. Derivation: docs/derivations/rolling_shutter.md.
#include <gtest/gtest.h>

#include "estimator/factors/track.h"
#include "tests/estimator/factors/smooth_settings.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

/// Sum of the squared residuals, in sigmas of 0.5 px, at the true states and without noise of the tracks.
double misfit(double readout_s, bool rows, TrackNoiseModel noise) {
  SyntheticWindow s = make_window({.pixel_noise = 0, .state_error = 0, .readout_s = readout_s});
  TrackFactor factor(best_instruction_set());
  VisualSettings settings = test::smooth_settings();
  settings.noise = noise;
  settings.drift_sigma = 0.5;
  settings.rows = rows;
  factor.collect(*s.window, settings);
  return factor.cost(*s.window);
}

class RollingShutterFactor : public testing::TestWithParam<TrackNoiseModel> {};

TEST_P(RollingShutterFactor, ExplainsWhatTheMiddleRowDoesNot) {
  const double middle_row = misfit(0.033, false, GetParam()), rows = misfit(0.033, true, GetParam());
  EXPECT_GT(middle_row, 10);
  EXPECT_LT(rows, 1e-3 * middle_row);  // what the acceleration does within an image is left
}

TEST_P(RollingShutterFactor, IsTheGlobalOneWhereAllRowsAreOfTheStamp) {
  EXPECT_EQ(misfit(0, true, GetParam()), misfit(0, false, GetParam()));
}

INSTANTIATE_TEST_SUITE_P(Noise, RollingShutterFactor,
                         testing::Values(TrackNoiseModel::kWhite, TrackNoiseModel::kDrift));

}  // namespace
}  // namespace epiline
