// The right-hand side of every factor against the slope of its own cost, on every instruction set of this machine; and
// that no factor but a prior sees the position and the heading of the whole.
// Derivations: docs/derivations/track.md, docs/derivations/drift.md, docs/derivations/calibration.md,
// docs/derivations/imu.md, docs/derivations/wheel.md, docs/derivations/height.md, docs/derivations/zero_motion.md,
// docs/derivations/marginalisation.md, docs/derivations/several_cameras.md.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "estimator/factors/calibration_prior.h"
#include "estimator/factors/height.h"
#include "estimator/factors/imu.h"
#include "estimator/factors/prior.h"
#include "estimator/factors/track.h"
#include "estimator/factors/wheel.h"
#include "estimator/factors/zero_motion.h"
#include "tests/estimator/factors/gradient.h"
#include "tests/estimator/slope.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

class Gradient : public testing::TestWithParam<std::string> {
 protected:
  /// Without a cost: not on this machine.
  Subject make(const Window& w) {
    const std::string& name = GetParam();
    if (name == "prior") return {name, add_prior, 1};
    const auto of = [&](auto add, double step, bool velocity_biases) {
      return Subject{name,
                     [add](const Window& at, NormalEquations* out) {
                       return add(at, {at.size(), false}, out);
                     },
                     step, velocity_biases};
    };
    if (name == "calibration_prior") return of(add_calibration_prior, 0.01, false);
    if (name == "wheel") return of(add_wheel, 0.01, false);
    if (name == "height") return of(add_height, 0.01, false);
    if (name == "zero_motion") return of(add_zero_motion, 1, true);
    for (const InstructionSet set : kInstructionSets) {
      if (!runs_here(set) || !name.ends_with(std::string("_") + name_of(set))) continue;
      if (name.starts_with("imu"))
        return {name,
                [set](const Window& at, NormalEquations* out) {
                  return add_imu(at, {at.size(), false}, factor_kernels(set), out);
                },
                1};
      return visual(name, w, std::make_shared<TrackFactor>(set), 0.02,
                    name.starts_with("drift") ? TrackNoiseModel::kDrift : TrackNoiseModel::kWhite,
                    name.find("_rows_") != std::string::npos);
    }
    return {};
  }
};

TEST_P(Gradient, IsTheSlopeOfTheCostAndLeavesPositionAndYawOpen) {
  const bool rows = GetParam().find("_rows_") != std::string::npos;
  const bool second = GetParam().find("_second_") != std::string::npos;
  const bool fisheye = GetParam().find("_fisheye_") != std::string::npos;
  SyntheticWindow s = furnished_window(rows ? 0.05 : 0, second, fisheye);
  const Subject subject = make(*s.window);
  if (!subject.cost) GTEST_SKIP() << "not on this machine";
  check_gradient(subject, *s.window);
  // else the newest view would move with its velocity, of which its factor takes no slope
  s.window->calibration.time_offset = 0;
  // a prior knows where the window is; zero motion is a difference along the world's axes, which turn with everything
  if (GetParam() != "prior" && GetParam() != "zero_motion") check_gauge(subject, *s.window);
}

/// Where two rays pass each other.
Vec3 nearest_point(const Window& w, const TrackRecord& t, int i, int j) {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  for (const int k : {i, j}) {
    const NavState& x = w.at(k).x;
    const Vec3 f = x.R * w.calibration.R_BC * bearing_of(w.view(t, k));
    const Mat3 across = Mat3::Identity() - f * f.transpose();
    A += across;
    b += across * (x.p + x.R * w.calibration.p_BC);
  }
  return A.inverse() * b;
}

class HeldDepth : public Gradient {};

/// The last camera all but touches the point it sees: a hundredth of the first one's distance is left. There the
/// depth along the bearing is held, and has no slope.
TEST_P(HeldDepth, HasNoSlope) {
  SyntheticWindow s = make_window({.frames = 6, .tracks = 12, .state_error = 0});
  Window& w = *s.window;
  const int last = w.size() - 1;
  int chosen = 0;
  for (int i = 0; i < w.track_count(); ++i) {
    const TrackRecord& t = w.track(i);
    if (w.seen(t, 0) && w.seen(t, last - 1) && w.seen(t, last)) chosen = i;
    w.track(i).in_use = false;
  }
  TrackRecord& t = w.track(chosen);
  t.in_use = true;
  const Vec3 P = nearest_point(w, t, 0, last - 1);
  NavState& x = w.at(last).x;
  const Vec3 f = x.R * w.calibration.R_BC * bearing_of(w.view(t, last));
  const double distance = (P - w.at(0).x.p).norm();
  x.p = P - distance * (0.01 * f + 0.0005 * f.unitOrthogonal()) - x.R * w.calibration.p_BC;
  const Subject subject = make(w);
  if (!subject.cost) GTEST_SKIP() << "not on this machine";
  const auto slope_along = [&](const Vec3& direction) {
    const Vec3 keep = x.p;
    const double found = slope(
        [&](double d) {
          x.p = keep + d * direction;
          return subject.cost(w, nullptr);
        },
        1e-4);
    x.p = keep;
    return found;
  };
  ASSERT_LT(std::abs(slope_along(f)), 1e-6 * std::abs(slope_along(f.unitOrthogonal()))) << "it is not held";
  // A depth that is held depends on the scale of the homogeneous point, which the elimination takes for free: 2e-5 to
  // 6e-5 in two draws of the window. With a slope it would be 3e-4.
  check_gradient(subject, w, 1e-4);
}

const auto name_of_subject = [](const testing::TestParamInfo<std::string>& test) { return test.param; };
INSTANTIATE_TEST_SUITE_P(
    Factors, Gradient,
    testing::ValuesIn(on_every_set({"track", "drift", "drift_second", "track_rows", "drift_rows", "drift_second_rows",
                                    "track_fisheye", "drift_second_fisheye", "imu"},
                                   {"prior", "calibration_prior", "wheel", "height", "zero_motion"})),
    name_of_subject);
INSTANTIATE_TEST_SUITE_P(Factors, HeldDepth, testing::ValuesIn(on_every_set({"track"})), name_of_subject);

}  // namespace
}  // namespace epiline::test
