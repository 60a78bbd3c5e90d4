#include "drivers/study/montecarlo/correlated_noise.h"

#include <cmath>
#include <unordered_map>

#include "drivers/flights/simulate/random.h"

namespace epiline {

void add_correlated_noise(const CorrelatedNoise& noise, std::uint64_t seed, SimulatedFlight& flight) {
  constexpr std::uint64_t kStream = 101;
  if (noise.sigma_px <= 0) return;
  Random random(seed, kStream);
  const double a = std::exp(-1 / noise.images), step_px = noise.sigma_px * std::sqrt(1 - a * a);
  std::unordered_map<std::uint32_t, Vec2> offsets;  // of the tracks alive, by id
  for (std::size_t k = 0; k < flight.images.size(); ++k) {
    const double interval_s = k > 0 ? (flight.images[k].stamp - flight.images[k - 1].stamp).seconds() : 0;
    std::unordered_map<std::uint32_t, Vec2> alive;
    for (std::size_t i = flight.images[k].begin; i < flight.images[k].end; ++i) {
      TrackObservation& o = flight.observations[i];
      const auto before = offsets.find(o.id);
      const bool goes_on = o.age > 0 && before != offsets.end();
      const Vec2 offset = goes_on ? Vec2(a * before->second + random.normal2(step_px)) : random.normal2(noise.sigma_px);
      o.pixel += offset;
      if (goes_on) o.velocity_px_s += (offset - before->second) / interval_s;
      alive[o.id] = offset;
    }
    offsets = std::move(alive);
  }
}

}  // namespace epiline
