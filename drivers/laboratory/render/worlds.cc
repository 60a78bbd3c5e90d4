// The worlds, each built around the box that the camera's path fills. They return the space that movers walk in.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drivers/laboratory/render/world_builder.h"

namespace epiline {
namespace {

constexpr Material kHallWalls[] = {Material::kConcrete, Material::kBrick, Material::kRibs,  Material::kMachine,
                                   Material::kPosters,  Material::kPaint, Material::kMetal, Material::kFacade};
constexpr Material kHallFloor[] = {Material::kConcrete, Material::kWood, Material::kTiles, Material::kMetal};
constexpr Material kHallCeiling[] = {Material::kRibs, Material::kPaint, Material::kMesh};
constexpr Material kHallThings[] = {Material::kMachine, Material::kMetal, Material::kWood, Material::kMesh,
                                    Material::kPosters, Material::kRibs,  Material::kPaint};

Bounds hall(WorldBuilder& b, Bounds box) {
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

Bounds room(WorldBuilder& b, Bounds box) {
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

Bounds corridor(WorldBuilder& b, Bounds box) {
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

void trees(WorldBuilder& b, const Bounds& box, int count) {
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

Bounds outdoor(WorldBuilder& b, Bounds box) {
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
Bounds fields(WorldBuilder& b, Bounds box) {
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

Bounds bounds_of(const std::vector<Vec3>& path) {
  Bounds b{path.front(), path.front()};
  for (const Vec3& p : path) {
    b.low = b.low.cwiseMin(p);
    b.high = b.high.cwiseMax(p);
  }
  return b;
}

}  // namespace

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
