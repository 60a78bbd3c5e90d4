#pragma once
// What worlds are built of: walls, boxes, pipes, railings, clutter, all away from the camera's path.
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "drivers/flights/motion/random.h"
#include "drivers/laboratory/render/world.h"

namespace epiline {

using Materials = std::span<const Material>;                       ///< one of them is taken
inline constexpr double kFine = 320, kUsual = 240, kCoarse = 160;  // texels per metre

/// Share of the light a surface gets by where it faces: from above most, from below little.
double light_on(const Vec3& normal);

struct Bounds {
  Vec3 low, high;
  Vec3 size() const { return high - low; }
  Vec3 centre() const { return 0.5 * (low + high); }
};

/// Widens an interval to at least `size` about its centre.
void widen(Bounds& b, int axis, double size);

/// Places things where a camera will not run into them.
class WorldBuilder {
 public:
  WorldBuilder(const std::vector<Vec3>& path, std::uint64_t seed) : random_(seed, 77), path_(path) {}

  Random& random() { return random_; }
  const Vec3& start() const { return path_.front(); }
  World take() && { return std::move(world_); }
  World& world() { return world_; }

  double uniform(double low, double high) { return random_.uniform(low, high); }
  Material any(Materials choice) {
    return choice[static_cast<std::size_t>(random_.uniform(0, static_cast<double>(choice.size())))];
  }
  Vec2 anywhere() { return {uniform(0, TextureAtlas::size(0)), uniform(0, TextureAtlas::size(0))}; }

  /// Whether a box keeps its distance from the path.
  bool is_clear(const Vec3& centre, const Vec3& size, double yaw) const;

  void box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m, double light);

  bool clear_box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m,
                 double light);

  /// A round bar along a coordinate axis, as a prism of twelve sides; a highlight runs along it.
  void pipe(const Vec3& centre, int axis, double length, double radius, Material material, double light);

  /// A wall, floor or ceiling in patches of about `patch_m`, each of its own material and light.
  void wall(const Vec3& centre, const Vec3& e_u, const Vec3& e_v, double size_u, double size_v, double patch_m,
            Materials materials, double texels_per_m, double light);

  /// The six inner sides of a room.
  void shell(const Bounds& b, double patch_m, Materials walls, Materials floor, Materials ceiling, double light);

  /// Lamps under a ceiling.
  void lamps(const Bounds& b, double pitch_m);

  /// Things that stand on the floor, some with smaller things on top.
  void clutter(const Bounds& b, int count, const Vec3& smallest, const Vec3& largest, Materials materials,
               double light);

  /// Thin things in front of others: posts with rails.
  void railing(const Vec3& begin, int axis, double length, double light);

  /// Small things within a few metres of the path, in front of everything else: boards with gaps, gratings, poles,
  /// parts on wires. What is seen between them moves differently, which is what ends most tracks in a real hall.
  void near_things(double per_place, int most, Materials materials, double light);

  /// A pallet: five boards with gaps, lying or standing.
  void boards(const Vec3& centre, double yaw, bool lying, Material material, double light);

  /// Bars across each other, 0.8 m wide.
  void grating(const Vec3& centre, double yaw, double light);

  void movers(int count, double floor_z, const Bounds& b);

 private:
  /// Cubes of 1.5 m that the path goes through.
  std::size_t places_visited() const;

  Random random_;
  const std::vector<Vec3>& path_;
  World world_;
};

}  // namespace epiline
