// docs/derivations/height.md#tracks-near-a-beam
#include "estimator/factors/beam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "estimator/factors/height.h"
#include "estimator/geometry/so3.h"
#include "tests/estimator/slope.h"
#include "tests/estimator/synthetic_window.h"

namespace epiline::test {
namespace {

constexpr int kBeamFrame = 2;
constexpr std::size_t kRangeFinder = 1;
constexpr double kBearingSigma = 1e-3;

struct OverGround {
  double height_m = 10, step_m = 0.5;  ///< `step_m`: from frame to frame
  double noise = 0;                    ///< of bearings, in units of kBearingSigma
  double scale = 1;                    ///< of the states
  double turned_rad = 0;               ///< by how much attitudes differ at random
  double ground_walk = 0.05;
  unsigned seed = 1;
};

/// A camera that looks down at flat ground and moves sideways. Frame 2 has a beam to the ground.
std::unique_ptr<Window> window_over_ground(const OverGround& o) {
  auto window = std::make_unique<Window>(kMaxFrames);
  Window& w = *window;
  std::mt19937 rng(o.seed);
  std::normal_distribution<double> normal;
  const auto random = [&] { return Vec3(normal(rng), normal(rng), normal(rng)); };
  w.calibration.R_BC << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  w.calibration.p_BC = {0.05, -0.02, 0.03};
  w.height_sigmas_m = {0.1, 0.1};
  for (int k = 0; k < 6; ++k) {
    Slot& slot = w.append();
    slot.image_stamp = slot.time = HostStamp{k * 100'000'000};
    slot.x.R = so3_exp(o.turned_rad * random());
    const Vec3 p = Vec3(o.step_m * k, 0, o.height_m) + 0.2 * o.step_m * random(), c = p + slot.x.R * w.calibration.p_BC;
    slot.x.p = o.scale * c - slot.x.R * w.calibration.p_BC;
    TrackedFrame frame;
    frame.stamp = slot.image_stamp;
    for (int i = 0; i < 40; ++i) {
      const Vec3 point((i % 8 - 3) * 0.05 * o.height_m, (i / 8 - 2) * 0.05 * o.height_m, 0);
      const Vec3 noise_px = kFocal * kBearingSigma * o.noise * random();
      frame.features.push_back(make_feature(static_cast<std::uint32_t>(i + 1),
                                            (slot.x.R * w.calibration.R_BC).transpose() * (point - c),
                                            noise_px.head<2>()));
    }
    w.observe(frame);
    if (k != kBeamFrame) continue;
    const double distance = p.z() / slot.x.R(2, 2);
    slot.heights[kRangeFinder] = {true, 1, 0, -distance * Vec3::UnitZ(), 0};
  }
  choose_beam_tracks(w, {kBearingSigma, 0.1, o.ground_walk, 0}, {});
  return window;
}

BeamResidual residual(const Window& w, int frames) {
  BeamResidual out;
  evaluate_beam(w, kBeamFrame, frames, true, out);
  return out;
}

TEST(BeamFactor, JacobianEqualsNumericalDerivative) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const auto window = window_over_ground({.noise = 3, .scale = 1.1, .turned_rad = 0.1, .seed = seed});
    Window& w = *window;
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
  const auto window = window_over_ground({.noise = 3, .scale = 1.1, .turned_rad = 0.1});
  Window& w = *window;
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

TEST(BeamFactor, TellsTheScaleOfALevelFlight) {
  for (const double scale : {1.0, 1.01, 0.9}) {
    const auto window = window_over_ground({.height_m = 100, .step_m = 5, .scale = scale});
    const BeamResidual out = residual(*window, window->size());
    ASSERT_TRUE(out.active);
    EXPECT_NEAR(out.r / window->at(kBeamFrame).beam.drop_m, 1 / scale - 1, 1e-4)
        << "the reciprocal of the distance counts";
  }
}

/// Noise in bearings makes rays meet too near where the way is short against the distance, by several sigmas: not so
/// the reciprocal of the distance.
TEST(BeamFactor, IsNotBiasedByNoise) {
  for (const double step_m : {0.5, 0.1, 0.06}) {
    constexpr int kRuns = 400;
    double sum = 0, squares = 0, variance = 0;
    for (int run = 0; run < kRuns; ++run) {
      const auto window =
          window_over_ground({.step_m = step_m, .noise = 1, .ground_walk = 0, .seed = static_cast<unsigned>(run)});
      const double r = residual(*window, window->size()).r, depth = window->at(kBeamFrame).beam.variance - 0.01;
      sum += r;
      squares += r * r;
      variance += depth;
    }
    const double sigma = std::sqrt(variance / kRuns);
    EXPECT_LT(std::abs(sum / kRuns), 0.25 * sigma) << step_m;
    EXPECT_NEAR(std::sqrt(squares / kRuns), sigma, 0.25 * sigma) << step_m;
  }
}

TEST(BeamFactor, ATrackServesOneFrame) {
  const auto window = window_over_ground({});
  Window& w = *window;
  const BeamTracks first = w.at(kBeamFrame).beam;
  ASSERT_EQ(first.count, 4);
  w.at(kBeamFrame).beam = {};
  choose_beam_tracks(w, {kBearingSigma, 0.1, 0.5, 0}, first.ids);
  for (const std::uint32_t id : w.at(kBeamFrame).beam.ids)
    EXPECT_EQ(std::count(first.ids.begin(), first.ids.end(), id), 0) << id;
  w.at(4).heights[kRangeFinder] = w.at(kBeamFrame).heights[kRangeFinder];
  choose_beam_tracks(w, {kBearingSigma, 0.1, 0.5, 0}, {});
  const BeamTracks &a = w.at(kBeamFrame).beam, &b = w.at(4).beam;
  for (int i = 0; i < b.count; ++i)
    EXPECT_EQ(std::count(a.ids.begin(), a.ids.begin() + a.count, b.ids[static_cast<std::size_t>(i)]), 0);
}

}  // namespace
}  // namespace epiline::test
