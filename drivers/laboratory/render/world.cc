#include "drivers/laboratory/render/world.h"

#include <cmath>
#include <numbers>

#include "drivers/laboratory/render/worlds.h"

namespace epiline {
namespace {

Bounds bounds_of(const std::vector<Vec3>& path) {
  Bounds b{path.front(), path.front()};
  for (const Vec3& p : path) {
    b.low = b.low.cwiseMin(p);
    b.high = b.high.cwiseMax(p);
  }
  return b;
}

constexpr std::array<const char*, kAllWorlds.size()> kNames{"hall", "room", "corridor", "outdoor", "fields"};

}  // namespace

const char* to_string(WorldKind kind) { return kNames[static_cast<std::size_t>(kind)]; }

std::optional<WorldKind> world_from(std::string_view name) {
  for (const WorldKind kind : kAllWorlds)
    if (name == to_string(kind)) return kind;
  return std::nullopt;
}

double gloss_of(Material material) {
  switch (material) {
    case Material::kMetal:
      return 350;
    case Material::kMachine:
    case Material::kRibs:
      return 150;
    case Material::kTiles:
    case Material::kPosters:
    case Material::kWood:
      return 60;
    default:
      return 0;
  }
}

Vec3 Mover::centre(double t_s) const {
  return from + (0.5 - 0.5 * std::cos(2 * std::numbers::pi * t_s / period_s + phase_rad)) * (to - from);
}

World make_world(WorldKind kind, const std::vector<Vec3>& path, int movers, std::uint64_t seed) {
  WorldBuilder b(path, seed);
  const Bounds box = bounds_of(path);
  const auto build = [&] {
    switch (kind) {
      case WorldKind::kHall:
        return hall(b, box);
      case WorldKind::kRoom:
        return room(b, box);
      case WorldKind::kCorridor:
        return corridor(b, box);
      case WorldKind::kFields:
        return fields(b, box);
      case WorldKind::kOutdoor:
        return outdoor(b, box);
    }
    return box;
  };
  const Bounds inside = build();
  b.movers(movers, inside.low.z(), inside);
  return std::move(b).take();
}

}  // namespace epiline
