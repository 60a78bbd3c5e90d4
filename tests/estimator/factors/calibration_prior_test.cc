// The prior of the camera's pose on the IMU: slope of its cost, and how it lets go of a calibration that is wrong.
#include "estimator/factors/calibration_prior.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/estimator/factors/named_blocks.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline {
namespace {

using test::NamedBlocks;

SyntheticWindow window_off_by(const CalibrationTangent& d) {
  SyntheticWindow s = make_window({.frames = 3});
  Window& w = *s.window;
  w.calibration_prior = {true, w.calibration, 1e-3, 2e-3};
  retract(w.calibration, d);
  return s;
}

TEST(CalibrationPrior, ItsRightHandSideIsTheSlopeOfItsCost) {
  CalibrationTangent d;
  d << 0.003, 0.02, -0.05, 0.03, 0.004, 0.001, -0.01;
  SyntheticWindow s = window_off_by(d);
  Window& w = *s.window;
  NamedBlocks blocks;
  add_calibration_prior(w, {w.size(), false}, &blocks);
  for (int i = 0; i < kCalibration; ++i) {
    constexpr double kStep = 1e-6;
    const auto cost = [&](double by) {
      const Calibration kept = w.calibration;
      CalibrationTangent e = CalibrationTangent::Zero();
      e[i] = by;
      retract(w.calibration, e);
      const double c = add_calibration_prior(w, {w.size(), false}, nullptr);
      w.calibration = kept;
      return c;
    };
    // the cost is chi^2: twice the negative right-hand side
    const double b = blocks.slope(calibration_of_camera(), i);
    EXPECT_NEAR((cost(kStep) - cost(-kStep)) / (2 * kStep), -2 * b, 1e-4 * (1 + std::abs(b))) << i;
  }
}

TEST(CalibrationPrior, HoldsWhatIsNearAndLetsGoOfWhatIsFar) {
  const auto information = [](double off_rad) {
    CalibrationTangent d = CalibrationTangent::Zero();
    d[2] = off_rad;
    SyntheticWindow s = window_off_by(d);
    NamedBlocks blocks;
    add_calibration_prior(*s.window, {s.window->size(), false}, &blocks);
    return blocks.curvature(calibration_of_camera(), 2);
  };
  EXPECT_NEAR(information(0), 1 / (1e-3 * 1e-3), 1) << "the standard deviation configured";
  EXPECT_LT(information(0.35), 1 / (0.15 * 0.15)) << "20 degrees off, it knows it to 9 degrees only";
}

TEST(CalibrationPrior, GoesWithNoFrameAndOnlyWhereItIsEstimated) {
  SyntheticWindow s = window_off_by(CalibrationTangent::Constant(0.01));
  EXPECT_GT(add_calibration_prior(*s.window, {3, false}, nullptr), 0);
  EXPECT_EQ(add_calibration_prior(*s.window, {3, true}, nullptr), 0);
  s.window->calibration_prior.in_use = false;
  EXPECT_EQ(add_calibration_prior(*s.window, {3, false}, nullptr), 0);
}

}  // namespace
}  // namespace epiline
