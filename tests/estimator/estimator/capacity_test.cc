// More tracks than the window has room for, which are refused newest first.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/estimator/estimator/rig.h"

namespace epiline::test {
namespace {

/// Every track lasts a second, then its point is found anew: an ended track stays in the window while its frames do.
struct ShortTracks {
  /// `draw`: another one of points and noise.
  explicit ShortTracks(std::size_t features, std::size_t draw = 0)
      : rig(Flight{.moving_from = -2}, largest_window(), 3600 + draw) {
    rig.most_features = features;
    rig.spoil = [this](TrackedFrame& frame) {
      for (TrackedFeature& f : frame.features) f.id += 10'000 * ((image + 7 * f.id) / 20);
      ++image;
    };
    rig.run_to(14, [&] {
      if (rig.now() < 6 || !rig.last().solved) return;
      ++frames;
      tracking += rig.odometry().health.state == HealthState::kTracking;
      error += rig.velocity_error();
      worst_sigmas = std::max(worst_sigmas, rig.velocity_error() / rig.sigma_velocity());
      sigma += rig.sigma_velocity();
    });
  }
  static EstimatorConfig largest_window() {
    EstimatorConfig config;
    config.keyframes = 20;
    return config;
  }
  Rig rig;
  std::uint32_t image = 0;
  int frames = 0, tracking = 0;
  double error = 0, sigma = 0, worst_sigmas = 0;
};

/// A track that is refused is offered again with every image and gets in when an older one leaves, so that the newest
/// frame is never without tracks: as good as with 120 features, of which none is refused, and known better.
/// Means of eight seconds scatter by a quarter from one draw of the noise to the next.
TEST(EstimatorCapacity, AFullTableFliesAsWellAsOneWithRoom) {
  const ShortTracks full(400), fewer(120);
  EXPECT_EQ(fewer.rig.stats().tracks_refused, 0u);
  EXPECT_GT(full.rig.stats().tracks_refused, 1000u);
  EXPECT_GT(full.rig.stats().tracks_used / full.rig.stats().solves, 700u);
  for (const ShortTracks* f : {&full, &fewer}) {
    EXPECT_EQ(f->tracking, f->frames);
    EXPECT_LT(f->worst_sigmas, 3);
    EXPECT_EQ(f->rig.stats().resets, 0u);
  }
  double full_error = full.error, fewer_error = fewer.error;
  for (std::size_t draw = 1; draw < 5; ++draw) {
    full_error += ShortTracks(400, draw).error;
    fewer_error += ShortTracks(120, draw).error;
  }
  EXPECT_LT(full_error, 1.3 * fewer_error);
  EXPECT_LT(full.sigma, fewer.sigma);
}

}  // namespace
}  // namespace epiline::test
