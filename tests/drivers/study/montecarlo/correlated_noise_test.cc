#include "drivers/study/montecarlo/correlated_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

namespace epiline {
namespace {

/// Tracks that never end, and nothing else: what is added is all there is.
SimulatedFlight flight_of(std::uint32_t tracks, std::size_t images) {
  SimulatedFlight flight;
  flight.images.resize(images);
  for (std::size_t k = 0; k < images; ++k) {
    SimulatedImage& image = flight.images[k];
    image.stamp = kFlightBegin + Span{static_cast<std::int64_t>(k) * 50'000'000};
    image.begin = flight.observations.size();
    for (std::uint32_t id = 0; id < tracks; ++id)
      flight.observations.push_back({id, static_cast<std::uint32_t>(k), Vec2::Zero(), Vec2::Zero()});
    image.end = flight.observations.size();
  }
  return flight;
}

TEST(CorrelatedNoise, HasTheVarianceAndMemoryAskedForAtEveryAge) {
  constexpr std::uint32_t kTracks = 4000;
  constexpr std::size_t kImages = 25;
  SimulatedFlight flight = flight_of(kTracks, kImages);
  add_correlated_noise({.sigma_px = 0.7, .images = 10}, 3, flight);
  const auto mean_product = [&](std::size_t a, std::size_t b) {
    double sum = 0;
    for (std::size_t id = 0; id < kTracks; ++id)
      sum += flight.observations[a * kTracks + id].pixel.dot(flight.observations[b * kTracks + id].pixel);
    return sum / (2.0 * kTracks);
  };
  // 8000 draws: a variance is known to 1.6 %, a covariance of unit-variance draws to 1.1 % of the variance
  for (const std::size_t k : {std::size_t{0}, std::size_t{5}, kImages - 1})
    EXPECT_NEAR(mean_product(k, k), 0.49, 4 * 0.016 * 0.49) << "image " << k;
  for (const std::size_t lag : {1, 5, 10, 20})
    EXPECT_NEAR(mean_product(2, 2 + lag), 0.49 * std::exp(-0.1 * static_cast<double>(lag)), 4 * 0.016 * 0.49) << lag;
}

TEST(CorrelatedNoise, MovesVelocitiesAsItMovesPixels) {
  SimulatedFlight flight = flight_of(5, 4);
  add_correlated_noise({.sigma_px = 1, .images = 3}, 1, flight);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(flight.observations[i].velocity_px_s, Vec2::Zero());  // age 0: there was no image before
    const Vec2 moved = flight.observations[5 + i].pixel - flight.observations[i].pixel;
    EXPECT_NEAR((flight.observations[5 + i].velocity_px_s - moved / 0.05).norm(), 0, 1e-9);
  }
}

TEST(CorrelatedNoise, ZeroChangesNothingAndSeedsDiffer) {
  SimulatedFlight none = flight_of(3, 3), one = none, two = none, same = none;
  add_correlated_noise({.sigma_px = 0}, 1, none);
  add_correlated_noise({.sigma_px = 1}, 1, one);
  add_correlated_noise({.sigma_px = 1}, 1, same);
  add_correlated_noise({.sigma_px = 1}, 2, two);
  for (const TrackObservation& o : none.observations) EXPECT_EQ(o.pixel, Vec2::Zero());
  EXPECT_EQ(one.observations[4].pixel, same.observations[4].pixel);
  EXPECT_NE(one.observations[4].pixel, two.observations[4].pixel);
}

}  // namespace
}  // namespace epiline
