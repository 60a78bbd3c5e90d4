#include "drivers/laboratory/render/world.h"

#include <cmath>
#include <numbers>

namespace epiline {
namespace {

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

}  // namespace epiline
