#include "drivers/flights/motion/random.h"

#include <cmath>
#include <numbers>

namespace epiline {
namespace {
// SplitMix64's finaliser: neighbouring seeds must not give related engines.
std::uint64_t scramble(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}
}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream)
    : engine_(scramble(scramble(seed + 0x9e3779b97f4a7c15u) + stream)) {}

double Random::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));  // 1 - uniform() is never zero
  const double angle = 2 * std::numbers::pi * uniform();
  spare_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

Vec3 Random::normal3(double sigma) {
  Vec3 v;
  for (int i = 0; i < 3; ++i) v[i] = sigma * normal();
  return v;
}

Vec2 Random::normal2(double sigma) {
  Vec2 v;
  for (int i = 0; i < 2; ++i) v[i] = sigma * normal();
  return v;
}

}  // namespace epiline
