#pragma once
// What there is to see: flat rectangles with textures, built around the path of a camera so that it never runs into
// one.
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "drivers/laboratory/render/texture.h"
#include "estimator/geometry/types.h"

namespace epiline {

enum class WorldKind : std::uint8_t {
  kHall,      ///< machine hall: cluttered, 2 to 20 m deep
  kRoom,      ///< furnished room, 4 to 8 m
  kCorridor,  ///< narrow and long, with doors and blank stretches
  kOutdoor,   ///< a strip of ground with crates, posts, trees; hills far away
  kFields,    ///< flat land from above: fields, roads, some houses; finer around the places near the ground
};
inline constexpr std::array kAllWorlds{WorldKind::kHall, WorldKind::kRoom, WorldKind::kCorridor, WorldKind::kOutdoor,
                                       WorldKind::kFields};
const char* to_string(WorldKind kind);
std::optional<WorldKind> world_from(std::string_view name);

/// A rectangle, visible from the side its normal e_u x e_v points to. All in W, m.
struct Panel {
  Vec3 centre, e_u, e_v;  ///< unit axes, at right angles
  double half_u, half_v;  ///< half of its sides
  Material material;
  double texels_per_m;
  Vec2 texture_origin;  ///< texel at the centre
  double shade;         ///< light on it; times reflectance gives radiance
  Vec3 normal() const { return e_u.cross(e_v); }
};

/// Where most light comes from, and what glossy surfaces mirror; a unit vector in W.
inline const Vec3 kLamp_W = Vec3(0.3, 0.5, 0.81).normalized();

/// Radiance of the lamp mirrored in a surface.
double gloss_of(Material material);

/// A box that swings to and fro between two places: somebody walking.
struct Mover {
  Vec3 from, to;  ///< centre, m
  Vec3 size;
  double period_s, phase_rad, yaw_rad;
  std::vector<Panel> panels;  ///< with its centre at the origin
  Vec3 centre(double t_s) const;
};

struct World {
  std::vector<Panel> panels;
  std::vector<Mover> movers;
  double sky = 0;  ///< radiance where there is nothing
};

/// How far everything keeps away from the places a camera will visit, and how far the floor is below the lowest of them
/// at least (a flight may begin and end near the ground).
inline constexpr double kWorldClearance_m = 0.45, kFloorClearance_m = 0.35;

/// A world around the places a camera will visit (W, m; at least one). The same arguments give the same world.
World make_world(WorldKind kind, const std::vector<Vec3>& path, int movers, std::uint64_t seed);

/// The panels of an axis-parallel box turned by `yaw_rad` about its centre, each with light of its own.
std::vector<Panel> box_panels(const Vec3& centre, const Vec3& size, double yaw_rad, Material material,
                              double texels_per_m, const Vec2& texture_origin, double light);

}  // namespace epiline
