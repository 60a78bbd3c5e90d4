#include "drivers/flights/simulate/render/world.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "drivers/flights/simulate/random.h"
#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

constexpr double kFine = 320, kUsual = 240, kCoarse = 160;  // texels per metre

/// Share of the light a surface gets by where it faces: from above most, from below little.
double light_on(const Vec3& normal) {
  const double lamp = std::max(0.0, normal.dot(kLamp_W));
  const double window = std::max(0.0, normal.dot(Vec3(-0.8, 0.3, 0.52)));
  return 0.3 + 0.45 * lamp + 0.4 * window;
}

struct Bounds {
  Vec3 low, high;
  Vec3 size() const { return high - low; }
  Vec3 centre() const { return 0.5 * (low + high); }
};

Bounds bounds_of(const std::vector<Vec3>& path) {
  Bounds b{path.front(), path.front()};
  for (const Vec3& p : path) {
    b.low = b.low.cwiseMin(p);
    b.high = b.high.cwiseMax(p);
  }
  return b;
}

/// Widens an interval to at least `size` about its centre.
void widen(Bounds& b, int axis, double size) {
  const double missing = 0.5 * std::max(0.0, size - (b.high[axis] - b.low[axis]));
  b.low[axis] -= missing;
  b.high[axis] += missing;
}

class Builder {
 public:
  Builder(const std::vector<Vec3>& path, std::uint64_t seed) : random_(seed, 77), path_(path) {}

  Random& random() { return random_; }
  const Vec3& start() const { return path_.front(); }
  World take() && { return std::move(world_); }
  World& world() { return world_; }

  double uniform(double low, double high) { return random_.uniform(low, high); }
  template <std::size_t N>
  Material any(const Material (&choice)[N]) {
    return choice[static_cast<std::size_t>(random_.uniform(0, N))];
  }
  Vec2 anywhere() { return {uniform(0, TextureAtlas::size(0)), uniform(0, TextureAtlas::size(0))}; }

  /// Whether a box keeps its distance from the path.
  bool is_clear(const Vec3& centre, const Vec3& size, double yaw) const {
    const Mat3 R = so3_exp(Vec3(0, 0, -yaw));
    for (const Vec3& p : path_) {
      const Vec3 outside = ((R * (p - centre)).cwiseAbs() - 0.5 * size).cwiseMax(0);
      if (outside.squaredNorm() < kWorldClearance_m * kWorldClearance_m) return false;
    }
    return true;
  }

  void box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m, double light) {
    for (const Panel& p : box_panels(centre, size, yaw, material, texels_per_m, anywhere(), light))
      world_.panels.push_back(p);
  }

  bool clear_box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m,
                 double light) {
    if (!is_clear(centre, size, yaw)) return false;
    box(centre, size, yaw, material, texels_per_m, light);
    return true;
  }

  /// A round bar along a coordinate axis, as a prism of twelve sides; a highlight runs along it.
  void pipe(const Vec3& centre, int axis, double length, double radius, Material material, double light) {
    Vec3 size = Vec3::Constant(2 * radius);
    size[axis] = length;
    if (!is_clear(centre, size, 0)) return;
    constexpr int kSides = 12;
    const double half_side = radius * std::tan(std::numbers::pi / kSides);
    Vec3 e_u = Vec3::Zero(), across = Vec3::Zero(), up = Vec3::Zero();
    e_u[axis] = 1;
    across[(axis + 1) % 3] = 1;
    up[(axis + 2) % 3] = 1;
    const Vec2 origin = anywhere();
    for (int i = 0; i < kSides; ++i) {
      const double a = 2 * std::numbers::pi * i / kSides;
      const Vec3 normal = std::cos(a) * across + std::sin(a) * up;
      const Vec3 e_v = normal.cross(e_u);
      const double shine = 0.8 * std::pow(std::max(0.0, normal.dot(Vec3(0.3, 0.3, 0.9))), 8);
      world_.panels.push_back({centre + radius * normal, e_u, e_v, length / 2, half_side, material, kUsual,
                               origin + Vec2(0, kUsual * 2 * half_side * i), light * (light_on(normal) + shine)});
    }
  }

  /// A wall, floor or ceiling in patches of about `patch_m`, each of its own material and light.
  template <std::size_t N>
  void wall(const Vec3& centre, const Vec3& e_u, const Vec3& e_v, double size_u, double size_v, double patch_m,
            const Material (&materials)[N], double texels_per_m, double light) {
    const int nu = std::max(1, static_cast<int>(std::lround(size_u / patch_m)));
    const int nv = std::max(1, static_cast<int>(std::lround(size_v / patch_m)));
    const double du = size_u / nu, dv = size_v / nv;
    for (int i = 0; i < nu; ++i) {
      for (int j = 0; j < nv; ++j) {
        const Vec3 at = centre + ((i + 0.5) * du - size_u / 2) * e_u + ((j + 0.5) * dv - size_v / 2) * e_v;
        world_.panels.push_back({at, e_u, e_v, du / 2, dv / 2, any(materials), texels_per_m, anywhere(),
                                 light * light_on(e_u.cross(e_v)) * uniform(0.75, 1.25)});
      }
    }
  }

  /// The six inner sides of a room.
  template <std::size_t NW, std::size_t NF, std::size_t NC>
  void shell(const Bounds& b, double patch_m, const Material (&walls)[NW], const Material (&floor)[NF],
             const Material (&ceiling)[NC], double light) {
    const Vec3 c = b.centre(), s = b.size();
    const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
    wall({b.low.x(), c.y(), c.z()}, y, z, s.y(), s.z(), patch_m, walls, kUsual, light);
    wall({b.high.x(), c.y(), c.z()}, -y, z, s.y(), s.z(), patch_m, walls, kUsual, light);
    wall({c.x(), b.low.y(), c.z()}, -x, z, s.x(), s.z(), patch_m, walls, kUsual, light);
    wall({c.x(), b.high.y(), c.z()}, x, z, s.x(), s.z(), patch_m, walls, kUsual, light);
    wall({c.x(), c.y(), b.low.z()}, x, y, s.x(), s.y(), 2 * patch_m, floor, kUsual, light);
    wall({c.x(), c.y(), b.high.z()}, y, x, s.y(), s.x(), 2 * patch_m, ceiling, kCoarse, light);
  }

  /// Lamps under a ceiling.
  void lamps(const Bounds& b, double pitch_m) {
    for (double x = b.low.x() + pitch_m / 2; x < b.high.x(); x += pitch_m)
      for (double y = b.low.y() + pitch_m / 2; y < b.high.y(); y += pitch_m)
        clear_box({x, y, b.high.z() - 0.06}, {1.2, 0.18, 0.08}, 0, Material::kPaint, kCoarse, 4);
  }

  /// Things that stand on the floor, some with smaller things on top.
  template <std::size_t N>
  void clutter(const Bounds& b, int count, const Vec3& smallest, const Vec3& largest, const Material (&materials)[N],
               double light) {
    for (int i = 0; i < count; ++i) {
      Vec3 size;
      for (int k = 0; k < 3; ++k) size[k] = smallest[k] * std::pow(largest[k] / smallest[k], random_.uniform());
      const double yaw = random_.chance(0.6) ? 0.0 : uniform(-1.5, 1.5);
      const Vec3 centre(uniform(b.low.x(), b.high.x()), uniform(b.low.y(), b.high.y()), b.low.z() + size.z() / 2);
      if (!clear_box(centre, size, yaw, any(materials), random_.chance(0.5) ? kFine : kUsual,
                     light * uniform(0.5, 1.5)))
        continue;
      double top = b.low.z() + size.z();
      for (int k = 0; k < 3 && random_.chance(0.6); ++k) {
        const Vec3 small = size.cwiseProduct(Vec3(uniform(0.2, 0.7), uniform(0.2, 0.7), uniform(0.15, 0.5)));
        const Vec3 at(centre.x() + uniform(-0.25, 0.25) * size.x(), centre.y() + uniform(-0.25, 0.25) * size.y(),
                      top + small.z() / 2);
        if (!clear_box(at, small, yaw + uniform(-0.5, 0.5), any(materials), kFine, light * uniform(0.5, 1.6))) break;
        top += small.z();
      }
    }
  }

  /// Thin things in front of others: posts with rails.
  void railing(const Vec3& begin, int axis, double length, double light) {
    for (double along = 0; along <= length; along += 1.2) {
      Vec3 at = begin;
      at[axis] += along;
      clear_box(at + Vec3(0, 0, 0.5), {0.05, 0.05, 1}, 0, Material::kPaint, kFine, light);
    }
    Vec3 size = Vec3::Constant(0.05), middle = begin;
    size[axis] = length;
    middle[axis] += length / 2;
    for (const double z : {0.35, 0.7, 1.0}) clear_box(middle + Vec3(0, 0, z), size, 0, Material::kMetal, kFine, light);
  }

  /// Small things within a few metres of the path, in front of everything else: boards with gaps, gratings, poles,
  /// parts on wires. What is seen between them moves differently, which is what ends most tracks in a real hall.
  template <std::size_t N>
  void near_things(double per_place, int most, const Material (&materials)[N], double light) {
    const int count = std::clamp(static_cast<int>(per_place * static_cast<double>(places_visited())), most / 4, most);
    for (int i = 0; i < count; ++i) {
      const Vec3& beside = path_[static_cast<std::size_t>(uniform(0, static_cast<double>(path_.size())))];
      const double angle = uniform(0, 6.28), distance = uniform(0.6, 2);
      const Vec3 at = beside + distance * Vec3(std::cos(angle), std::sin(angle), uniform(-0.7, 0.4));
      const double yaw = uniform(-1.5, 1.5), brightness = light * uniform(0.4, 2.2);
      const Material material = any(materials);
      const int kind = static_cast<int>(uniform(0, 5));
      if (kind == 0) {
        clear_box(at, {uniform(0.08, 0.4), uniform(0.08, 0.4), uniform(0.08, 0.4)}, yaw, material, kFine, brightness);
      } else if (kind == 1) {
        boards(at, yaw, random_.chance(0.5), material, brightness);
      } else if (kind == 2) {
        grating(at, yaw, brightness);
      } else if (kind == 3) {  // a net: its meshes of 2 to 4 cm all look the same
        clear_box(at, {uniform(0.3, 1.2), uniform(0.3, 0.8), uniform(0.2, 0.8)}, yaw, Material::kMesh,
                  uniform(800, 1600), light * uniform(1, 3));
      } else {
        clear_box(at, {uniform(0.02, 0.08), uniform(0.02, 0.08), uniform(0.5, 2)}, yaw, material, kFine, brightness);
      }
    }
  }

  /// A pallet: five boards with gaps, lying or standing.
  void boards(const Vec3& centre, double yaw, bool lying, Material material, double light) {
    const Mat3 R = so3_exp(Vec3(0, 0, yaw));
    for (int k = -2; k <= 2; ++k) {
      const Vec3 offset = lying ? Vec3(0, 0.16 * k, 0) : Vec3(0, 0, 0.16 * k);
      const Vec3 size = lying ? Vec3(1, 0.1, 0.02) : Vec3(1, 0.02, 0.1);
      clear_box(centre + R * offset, size, yaw, material, kFine, light * uniform(0.8, 1.2));
    }
  }

  /// Bars across each other, 0.8 m wide.
  void grating(const Vec3& centre, double yaw, double light) {
    const Mat3 R = so3_exp(Vec3(0, 0, yaw));
    for (int k = -3; k <= 3; ++k) {
      clear_box(centre + R * Vec3(0.12 * k, 0, 0), {0.015, 0.015, 0.8}, yaw, Material::kMetal, kFine, light);
      clear_box(centre + R * Vec3(0, 0.01, 0.12 * k), {0.8, 0.015, 0.015}, yaw, Material::kMetal, kFine, light);
    }
  }

  void movers(int count, double floor_z, const Bounds& b) {
    for (int tries = 0; count > 0 && tries < 1000; ++tries) {
      Mover m;
      m.size = Vec3(0.35, 0.5, 1.75);
      m.from = Vec3(uniform(b.low.x(), b.high.x()), uniform(b.low.y(), b.high.y()), floor_z + m.size.z() / 2);
      const double angle = uniform(0, 6.28), length = uniform(1, 4);
      m.to = m.from + length * Vec3(std::cos(angle), std::sin(angle), 0);
      m.period_s = uniform(1.5, 3) * length;
      m.phase_rad = uniform(0, 6.28);
      m.yaw_rad = angle;
      if (!is_clear(0.5 * (m.from + m.to), m.size + Vec3(length, 0, 0), angle)) continue;
      m.panels = box_panels(Vec3::Zero(), m.size, angle, Material::kPosters, kFine, anywhere(), uniform(0.6, 1.4));
      world_.movers.push_back(std::move(m));
      --count;
    }
  }

 private:
  /// Cubes of 1.5 m that the path goes through.
  std::size_t places_visited() const {
    std::set<std::array<int, 3>> cubes;
    for (const Vec3& p : path_) {
      const Vec3 cube = (p / 1.5).array().floor();
      cubes.insert({static_cast<int>(cube.x()), static_cast<int>(cube.y()), static_cast<int>(cube.z())});
    }
    return cubes.size();
  }

  Random random_;
  const std::vector<Vec3>& path_;
  World world_;
};

constexpr Material kHallWalls[] = {Material::kConcrete, Material::kBrick, Material::kRibs,  Material::kMachine,
                                   Material::kPosters,  Material::kPaint, Material::kMetal, Material::kFacade};
constexpr Material kHallFloor[] = {Material::kConcrete, Material::kWood, Material::kTiles, Material::kMetal};
constexpr Material kHallCeiling[] = {Material::kRibs, Material::kPaint, Material::kMesh};
constexpr Material kHallThings[] = {Material::kMachine, Material::kMetal, Material::kWood, Material::kMesh,
                                    Material::kPosters, Material::kRibs,  Material::kPaint};

Bounds hall(Builder& b, Bounds box) {
  box.low -= Vec3(4.5, 4.5, 0.6);
  box.high += Vec3(4.5, 4.5, 3.5);
  widen(box, 0, 16);
  widen(box, 1, 12);
  box.high.z() = std::max(box.high.z(), box.low.z() + 6);
  b.shell(box, 2.5, kHallWalls, kHallFloor, kHallCeiling, 0.7);
  b.lamps(box, 4);
  const double area = box.size().x() * box.size().y();
  b.clutter(box, static_cast<int>(std::clamp(0.9 * area, 80.0, 500.0)), {0.3, 0.3, 0.3}, {2.5, 2.5, 3}, kHallThings,
            0.9);
  b.near_things(24, 400, kHallThings, 0.9);
  for (int i = 0; i < 26; ++i) {
    const int axis = b.random().chance(0.5) ? 0 : 1;
    Vec3 centre = box.centre();
    centre[1 - axis] = b.uniform(box.low[1 - axis] + 0.3, box.high[1 - axis] - 0.3);
    centre.z() = b.uniform(box.low.z() + 1.5, box.high.z() - 0.4);
    const double length = b.uniform(0.3, 0.95) * box.size()[axis];
    centre[axis] += b.uniform(-0.5, 0.5) * (box.size()[axis] - length);
    b.pipe(centre, axis, length, b.uniform(0.05, 0.35), Material::kMetal, b.uniform(0.5, 1.3));
  }
  for (int i = 0; i < 16; ++i) {
    const Vec3 centre(b.uniform(box.low.x(), box.high.x()), b.uniform(box.low.y(), box.high.y()), box.centre().z());
    b.clear_box(centre, {0.3, 0.3, box.size().z()}, 0, Material::kRibs, kUsual, b.uniform(0.5, 1.2));
  }
  for (int i = 0; i < 12; ++i) {
    const Vec3 begin(b.uniform(box.low.x(), box.high.x() - 4), b.uniform(box.low.y(), box.high.y() - 4), box.low.z());
    b.railing(begin, b.random().chance(0.5) ? 0 : 1, b.uniform(2, 4), b.uniform(0.7, 1.6));
  }
  return box;
}

constexpr Material kRoomWalls[] = {Material::kPaint, Material::kPosters, Material::kConcrete, Material::kPaint,
                                   Material::kBrick, Material::kWood,    Material::kPosters};
constexpr Material kRoomFloor[] = {Material::kWood, Material::kTiles, Material::kConcrete};
constexpr Material kRoomCeiling[] = {Material::kPaint, Material::kTiles};
constexpr Material kRoomThings[] = {Material::kWood, Material::kPosters, Material::kMachine, Material::kPaint,
                                    Material::kTiles};

Bounds room(Builder& b, Bounds box) {
  box.low -= Vec3(1.4, 1.4, kFloorClearance_m);
  box.high += Vec3(1.4, 1.4, 1.0);
  widen(box, 0, 7);
  widen(box, 1, 6);
  box.high.z() = std::max(box.high.z(), box.low.z() + 3);
  b.shell(box, 1.5, kRoomWalls, kRoomFloor, kRoomCeiling, 0.8);
  b.lamps(box, 2.5);
  b.clutter(box, 60, {0.25, 0.25, 0.3}, {1.4, 1.0, 1.9}, kRoomThings, 1);
  b.near_things(2, 40, kRoomThings, 1);
  return box;
}

constexpr Material kCorridorWalls[] = {Material::kPaint, Material::kPaint,   Material::kBrick,
                                       Material::kWood,  Material::kPosters, Material::kConcrete};
constexpr Material kCorridorCeiling[] = {Material::kPaint};
constexpr Material kCorridorFloor[] = {Material::kTiles, Material::kConcrete};

Bounds corridor(Builder& b, Bounds box) {
  const int along = box.size().x() >= box.size().y() ? 0 : 1, across = 1 - along;
  box.low[along] -= 4;
  box.high[along] += 12;
  box.low[across] -= 1.2;
  box.high[across] += 1.2;
  box.low.z() -= 1.0;
  box.high.z() += 1.2;
  b.shell(box, 2, kCorridorWalls, kCorridorFloor, kCorridorCeiling, 0.8);
  const double length = box.size()[along];
  for (double s = 1; s < length; s += 3) {
    Vec3 at = box.centre();
    at[along] = box.low[along] + s;
    at.z() = box.high.z() - 0.05;
    b.clear_box(at, along == 0 ? Vec3(1.2, 0.2, 0.06) : Vec3(0.2, 1.2, 0.06), 0, Material::kPaint, kCoarse, 4);
  }
  for (int i = 0; i < static_cast<int>(1.2 * length); ++i) {  // frames, boxes, pipes along the walls
    Vec3 at = box.centre(), size;
    at[along] = b.uniform(box.low[along], box.high[along]);
    size[along] = b.uniform(0.1, 0.9);
    size[across] = b.uniform(0.04, 0.25);
    size.z() = b.uniform(0.15, 1.2);
    at[across] = b.random().chance(0.5) ? box.low[across] + size[across] / 2 : box.high[across] - size[across] / 2;
    at.z() = b.uniform(box.low.z() + size.z() / 2, box.high.z() - size.z() / 2);
    b.clear_box(at, size, 0, b.any(kRoomThings), kFine, b.uniform(0.5, 1.5));
  }
  return box;
}

constexpr Material kGround[] = {Material::kGravel, Material::kGrass, Material::kGravel, Material::kConcrete};
constexpr Material kFar[] = {Material::kLandscape, Material::kFacade, Material::kLandscape};
constexpr Material kYard[] = {Material::kWood, Material::kMetal,   Material::kBrick,   Material::kPosters,
                              Material::kRibs, Material::kMachine, Material::kConcrete};

void trees(Builder& b, const Bounds& box, int count) {
  for (int i = 0; i < count; ++i) {
    const double height = b.uniform(2.5, 6);
    const Vec3 foot(b.uniform(box.low.x(), box.high.x()), b.uniform(box.low.y(), box.high.y()), box.low.z());
    if (!b.clear_box(foot + Vec3(0, 0, height / 2), {0.3, 0.3, height}, b.uniform(0, 1.5), Material::kWood, kUsual,
                     0.6))
      continue;
    for (int k = 0; k < 4; ++k) {
      const double s = b.uniform(0.8, 1.8);
      b.clear_box(foot + Vec3(b.uniform(-0.7, 0.7), b.uniform(-0.7, 0.7), height + b.uniform(-0.6, 0.8)), {s, s, s},
                  b.uniform(0, 1.5), Material::kGrass, kCoarse, b.uniform(0.6, 1.2));
    }
  }
}

Bounds outdoor(Builder& b, Bounds box) {
  const double floor = box.low.z() - 0.4;
  box.low.z() = box.high.z() = floor;
  Bounds ground = box;
  ground.low -= Vec3(80, 80, 0);
  ground.high += Vec3(80, 80, 0);
  b.wall(ground.centre(), Vec3::UnitX(), Vec3::UnitY(), ground.size().x(), ground.size().y(), 9, kGround, kUsual, 1.1);
  const double radius = 0.5 * ground.size().head<2>().norm() + 40;
  constexpr int kRing = 40;
  for (int i = 0; i < kRing; ++i) {
    const double a = 2 * std::numbers::pi * i / kRing;
    const Vec3 outwards(std::cos(a), std::sin(a), 0);
    const double height = b.uniform(8, 30);
    const Vec3 centre = ground.centre() + radius * outwards + Vec3(0, 0, height / 2 - 1);
    b.world().panels.push_back({centre, outwards.cross(Vec3::UnitZ()), Vec3::UnitZ(),
                                1.02 * radius * std::tan(std::numbers::pi / kRing), height / 2, b.any(kFar), 12,
                                b.anywhere(), b.uniform(0.6, 1.0)});
  }
  Bounds near = box;
  near.low -= Vec3(14, 14, 0);
  near.high += Vec3(14, 14, 0);
  const double area = near.size().x() * near.size().y();
  b.clutter(near, static_cast<int>(std::clamp(0.07 * area, 60.0, 400.0)), {0.2, 0.2, 0.2}, {3, 2, 2.2}, kYard, 1);
  trees(b, near, static_cast<int>(std::clamp(0.02 * area, 20.0, 120.0)));
  b.world().sky = 200;
  near.high.z() = floor + 2;
  return near;
}

constexpr Material kField[] = {Material::kGrass, Material::kGravel, Material::kLandscape, Material::kGrass};
constexpr Material kHouse[] = {Material::kFacade, Material::kBrick};

/// Ground whose texture suits the height it is seen from: finer patches lie a little above the coarser ones.
Bounds fields(Builder& b, Bounds box) {
  const double floor = box.low.z() - 0.55, height = box.high.z() - floor, margin = 30 + 1.3 * height;
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY();
  Bounds land{box.low - Vec3(margin, margin, 0), box.high + Vec3(margin, margin, 0)};
  land.low.z() = land.high.z() = floor;
  b.wall(land.centre(), x, y, land.size().x(), land.size().y(), 35, kField, 8, 1.1);
  struct Patch {
    double half_m, texels_per_m, above_m;
  };
  for (const Patch& p : {Patch{60, 40, 0.03}, Patch{18, kUsual, 0.05}}) {
    const Vec3 centre(b.start().x(), b.start().y(), floor + p.above_m);
    b.wall(centre, x, y, 2 * p.half_m, 2 * p.half_m, p.half_m / 4, kGround, p.texels_per_m, 1.1);
  }
  const auto road = [&](const Vec3& centre, const Vec3& size) { b.box(centre, size, 0, Material::kConcrete, 8, 1.5); };
  for (double at = land.low.x() + b.uniform(20, 60); at < land.high.x(); at += b.uniform(90, 160))
    road({at, land.centre().y(), floor}, {5, land.size().y(), 0.02});
  for (double at = land.low.y() + b.uniform(20, 60); at < land.high.y(); at += b.uniform(90, 160))
    road({land.centre().x(), at, floor}, {land.size().x(), 5, 0.022});
  const int houses = static_cast<int>(land.size().x() * land.size().y() / 6000);
  for (int i = 0; i < houses; ++i) {
    const Vec3 size(b.uniform(6, 12), b.uniform(6, 14), b.uniform(3, 7));
    const Vec3 at(b.uniform(land.low.x(), land.high.x()), b.uniform(land.low.y(), land.high.y()), floor + size.z() / 2);
    if ((at - b.start()).head<2>().norm() < 80) continue;  // not where the flight begins
    b.clear_box(at, size, b.uniform(0, 1.5), b.any(kHouse), 20, b.uniform(0.6, 1.4));
  }
  b.world().sky = 200;
  land.high.z() = floor + 2;
  return land;
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

std::vector<Panel> box_panels(const Vec3& centre, const Vec3& size, double yaw_rad, Material material,
                              double texels_per_m, const Vec2& texture_origin, double light) {
  std::vector<Panel> panels;
  const Mat3 R = so3_exp(Vec3(0, 0, yaw_rad));
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      // Upright sides have their texture's v axis up; top and bottom along the second horizontal axis.
      const int v = axis == 2 ? 1 : 2;
      const Vec3 normal = side * R.col(axis), e_v = R.col(v), e_u = e_v.cross(normal);
      panels.push_back({centre + 0.5 * size[axis] * normal, e_u, e_v, 0.5 * size[3 - axis - v], 0.5 * size[v], material,
                        texels_per_m, texture_origin + Vec2(300 * axis, 130 * side), light * light_on(normal)});
    }
  }
  return panels;
}

World make_world(WorldKind kind, const std::vector<Vec3>& path, int movers, std::uint64_t seed) {
  Builder b(path, seed);
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
