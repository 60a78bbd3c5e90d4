#pragma once
// Heights against each other within the window, from a sensor whose offset is unknown and walks. Derivation:
// docs/derivations/height.md; test: tests/estimator/factors/height_test.cc.
#include <array>
#include <cmath>

#include "estimator/factors/normal_equations.h"
#include "estimator/window/window.h"

namespace epiline {

/// The offset of a sensor as frame k tells it, m: the height of the point that it measures, by the state, minus the
/// measured height.
double height_offset(const HeightReading& reading, const NavState& x);
/// d height_offset / d (p, theta). Only the rotation matters; take it from the linearisation point.
Vec6 height_jacobian(const HeightReading& reading, const Mat3& R);

/// A frame's offset against the one that the newer frames of its series predict: r = sum share[j] offset_j, and
/// the shares sum to zero.
struct HeightInnovation {
  int frame = 0;
  double variance = 0;  ///< of r, m^2
  std::array<double, kMaxFrames> share{};
};
/// Calls `f(const HeightInnovation&)` for every frame of the first `frames` with a reading, except the newest of each
/// series, from new to old. Together they say all that the readings say when nothing is known of the offsets.
template <class F>
void each_innovation(const Window& w, HeightKind kind, int frames, F&& f) {
  const auto reading = [&](int k) -> const HeightReading& { return w.at(k).heights[static_cast<std::size_t>(kind)]; };
  const double sigma = w.height_sigmas_m[static_cast<std::size_t>(kind)], noise = sigma * sigma;
  std::array<bool, kMaxFrames> seen{};
  for (int newest = frames - 1; newest >= 0; --newest) {
    if (!reading(newest).has || seen[newest]) continue;
    // a Kalman filter of the offset, back in time; its mean is a sum of the newer frames' offsets
    std::array<double, kMaxFrames> mean{};
    mean[newest] = 1;
    double variance = noise;
    for (int k = newest - 1, last = newest; k >= 0; --k) {
      if (!reading(k).has || reading(k).series != reading(newest).series) continue;
      seen[k] = true;
      variance += std::abs(reading(last).walked_m2 - reading(k).walked_m2);
      last = k;
      HeightInnovation innovation{k, variance + noise, {}};
      for (std::size_t j = 0; j < kMaxFrames; ++j) innovation.share[j] = -mean[j];
      innovation.share[k] = 1;
      f(innovation);
      const double gain = variance / innovation.variance;
      for (std::size_t j = 0; j < kMaxFrames; ++j) mean[j] += gain * innovation.share[j];
      variance *= 1 - gain;
    }
  }
}

/// Both sensors. Returns the cost; null: the cost alone.
double add_height(const Window& window, const Share& share, NormalEquations* out);

}  // namespace epiline
