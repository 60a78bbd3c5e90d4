// docs/derivations/height.md#tracks-near-a-beam
#include "estimator/factors/beam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "estimator/factors/height.h"
#include "tests/estimator/slope.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

constexpr int kBeamFrame = 3;
constexpr std::size_t kRangeFinder = 1;

/// A window whose frame 3 has a beam of 5 m along the camera's axis, and tracks near it.
SyntheticWindow window_with_beam(const SyntheticOptions& options) {
  SyntheticWindow s = make_window(options);
  Window& w = *s.window;
  w.height_sigmas_m = {0.1, 0.1};
  const Vec3 lever = w.calibration.p_BC + 5 * Vec3::UnitX();
  w.at(kBeamFrame).heights[kRangeFinder] = {true, 1, 0, lever, 0};
  choose_beam_tracks(w, {1e-3, 0.1, 0.5, 0}, {});
  return s;
}

BeamResidual residual(const Window& w, int frames) {
  BeamResidual out;
  evaluate_beam(w, kBeamFrame, frames, true, out);
  return out;
}

TEST(BeamFactor, JacobianEqualsNumericalDerivative) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    SyntheticWindow s = window_with_beam({.tracks = 200, .seed = seed});
    Window& w = *s.window;
    for (const int frames : {w.size(), w.size() - 1}) {
      const BeamResidual at = residual(w, frames);
      ASSERT_TRUE(at.active);
      for (int k = 0; k < frames; ++k) {
        const NavState keep = w.at(k).x;
        for (int i = 0; i < 6; ++i) {
          const auto r = [&](double d) {
            w.at(k).x = keep;
            retract_pose(w.at(k).x, d * Vec6::Unit(i));
            return residual(w, frames).r;
          };
          const double numeric = slope(r, 1e-4);
          EXPECT_NEAR(at.J[static_cast<std::size_t>(k)][i], numeric, 1e-7 * (1 + std::abs(numeric)))
              << "seed " << seed << ", frame " << k << ", " << i;
        }
        w.at(k).x = keep;
      }
    }
  }
}

TEST(BeamFactor, PositionAndYawStayUnobservable) {
  SyntheticWindow s = window_with_beam({.tracks = 200});
  Window& w = *s.window;
  const BeamResidual at = residual(w, w.size());
  ASSERT_TRUE(at.active);
  Vec3 shift = Vec3::Zero();
  double yaw = 0;
  for (int k = 0; k < w.size(); ++k) {
    const NavState& x = w.at(k).x;
    const Vec6& J = at.J[static_cast<std::size_t>(k)];
    shift += J.head<3>();
    yaw += J.head<3>().dot(Vec3::UnitZ().cross(x.p)) + J.tail<3>().dot(x.R.transpose() * Vec3::UnitZ());
  }
  EXPECT_LT(shift.norm(), 1e-9);
  EXPECT_LT(std::abs(yaw), 1e-9);
}

/// A camera that looks down from `height` at flat ground and moves sideways; the states are `scale` times too large.
double residual_over_ground(double height, double scale) {
  const auto owned = std::make_unique<Window>(kMaxFrames);
  Window& w = *owned;
  w.calibration.R_BC << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  w.height_sigmas_m = {0.1, 0.1};
  for (int k = 0; k < 6; ++k) {
    Slot& slot = w.append();
    slot.image_stamp = slot.time = HostStamp{k * 100'000'000};
    const Vec3 p(0.05 * height * k, 0, height);
    slot.x.p = scale * p;
    TrackedFrame frame;
    frame.stamp = slot.image_stamp;
    for (int i = 0; i < 40; ++i) {
      const Vec3 point((i % 8 - 3) * 0.05 * height, (i / 8 - 2) * 0.05 * height, 0);
      frame.features.push_back(
          make_feature(static_cast<std::uint32_t>(i + 1), w.calibration.R_BC.transpose() * (point - p), Vec2::Zero()));
    }
    w.observe(frame);
  }
  w.at(2).heights[kRangeFinder] = {true, 1, 0, -height * Vec3::UnitZ(), 0};
  choose_beam_tracks(w, {1e-3, 0.1, 0.05, 0.3}, {});
  BeamResidual out;
  evaluate_beam(w, 2, w.size(), false, out);
  EXPECT_TRUE(out.active);
  return out.r;
}

TEST(BeamFactor, TellsTheScaleOfALevelFlight) {
  constexpr double kRounded = 1e-3;  // bearings of seven digits, over a way of a few metres
  EXPECT_NEAR(residual_over_ground(100, 1), 0, kRounded);
  EXPECT_NEAR(residual_over_ground(100, 1.01), -1, kRounded) << "the tracks lie a metre too deep";
  EXPECT_NEAR(residual_over_ground(30, 0.9), 3, kRounded);
}

TEST(BeamFactor, ATrackServesOneFrame) {
  SyntheticWindow s = window_with_beam({.tracks = 200});
  Window& w = *s.window;
  const BeamTracks first = w.at(kBeamFrame).beam;
  ASSERT_EQ(first.count, 4);
  w.at(kBeamFrame).beam = {};
  choose_beam_tracks(w, {1e-3, 0.1, 0.5, 0}, first.ids);
  for (const std::uint32_t id : w.at(kBeamFrame).beam.ids)
    EXPECT_EQ(std::count(first.ids.begin(), first.ids.end(), id), 0) << id;
  w.at(4).heights[kRangeFinder] = w.at(kBeamFrame).heights[kRangeFinder];
  choose_beam_tracks(w, {1e-3, 0.1, 0.5, 0}, {});
  const BeamTracks &a = w.at(kBeamFrame).beam, &b = w.at(4).beam;
  for (int i = 0; i < b.count; ++i)
    EXPECT_EQ(std::count(a.ids.begin(), a.ids.begin() + a.count, b.ids[static_cast<std::size_t>(i)]), 0);
}

}  // namespace
}  // namespace epiline::test
