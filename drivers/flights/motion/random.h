#pragma once
// Random numbers that are the same with every standard library: the engine is specified to the bit, the distributions
// of <random> are not.
#include <cstdint>
#include <random>

#include "estimator/geometry/types.h"

namespace epiline {

class Random {
 public:
  /// One seed gives many independent streams, so that more draws for one purpose do not change those for another.
  Random(std::uint64_t seed, std::uint64_t stream);
  /// In [0, 1), 53 random bits.
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  /// In [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  bool chance(double probability) { return uniform() < probability; }
  /// Standard normal (Box-Muller).
  double normal();
  /// Three independent normals of standard deviation `sigma`, drawn in the order x, y, z.
  Vec3 normal3(double sigma);
  Vec2 normal2(double sigma);

 private:
  std::mt19937_64 engine_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace epiline
