#pragma once
#include <cstdint>

#include "drivers/flights/simulate/track_simulator.h"

namespace epiline {

/// Noise of a track that changes slowly, as that of a tracker does: first-order autoregressive over the images,
/// x_k = a x_(k-1) + w with a = exp(-1 / images), bounded, of the same size at every age. Unlike TrackNoise::drift_px,
/// a random walk that grows with the age.
struct CorrelatedNoise {
  double sigma_px = 0;  ///< standard deviation of x in each image coordinate
  double images = 10;   ///< after that many the correlation has fallen to 1/e
};

/// Adds it to every observation, velocities included.
void add_correlated_noise(const CorrelatedNoise& noise, std::uint64_t seed, SimulatedFlight& flight);

}  // namespace epiline
