#include "drivers/laboratory/render/world_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "estimator/geometry/so3.h"

namespace epiline {

double light_on(const Vec3& normal) {
  const double lamp = std::max(0.0, normal.dot(kLamp_W));
  const double window = std::max(0.0, normal.dot(Vec3(-0.8, 0.3, 0.52)));
  return 0.3 + 0.45 * lamp + 0.4 * window;
}

void widen(Bounds& b, int axis, double size) {
  const double missing = 0.5 * std::max(0.0, size - (b.high[axis] - b.low[axis]));
  b.low[axis] -= missing;
  b.high[axis] += missing;
}

bool WorldBuilder::is_clear(const Vec3& centre, const Vec3& size, double yaw) const {
  const Mat3 R = so3_exp(Vec3(0, 0, -yaw));
  for (const Vec3& p : path_) {
    const Vec3 outside = ((R * (p - centre)).cwiseAbs() - 0.5 * size).cwiseMax(0);
    if (outside.squaredNorm() < kWorldClearance_m * kWorldClearance_m) return false;
  }
  return true;
}

void WorldBuilder::box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m,
                       double light) {
  for (const Panel& p : box_panels(centre, size, yaw, material, texels_per_m, anywhere(), light))
    world_.panels.push_back(p);
}

bool WorldBuilder::clear_box(const Vec3& centre, const Vec3& size, double yaw, Material material, double texels_per_m,
                             double light) {
  if (!is_clear(centre, size, yaw)) return false;
  box(centre, size, yaw, material, texels_per_m, light);
  return true;
}

void WorldBuilder::pipe(const Vec3& centre, int axis, double length, double radius, Material material, double light) {
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

void WorldBuilder::lamps(const Bounds& b, double pitch_m) {
  for (double x = b.low.x() + pitch_m / 2; x < b.high.x(); x += pitch_m)
    for (double y = b.low.y() + pitch_m / 2; y < b.high.y(); y += pitch_m)
      clear_box({x, y, b.high.z() - 0.06}, {1.2, 0.18, 0.08}, 0, Material::kPaint, kCoarse, 4);
}

void WorldBuilder::railing(const Vec3& begin, int axis, double length, double light) {
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

void WorldBuilder::boards(const Vec3& centre, double yaw, bool lying, Material material, double light) {
  const Mat3 R = so3_exp(Vec3(0, 0, yaw));
  for (int k = -2; k <= 2; ++k) {
    const Vec3 offset = lying ? Vec3(0, 0.16 * k, 0) : Vec3(0, 0, 0.16 * k);
    const Vec3 size = lying ? Vec3(1, 0.1, 0.02) : Vec3(1, 0.02, 0.1);
    clear_box(centre + R * offset, size, yaw, material, kFine, light * uniform(0.8, 1.2));
  }
}

void WorldBuilder::grating(const Vec3& centre, double yaw, double light) {
  const Mat3 R = so3_exp(Vec3(0, 0, yaw));
  for (int k = -3; k <= 3; ++k) {
    clear_box(centre + R * Vec3(0.12 * k, 0, 0), {0.015, 0.015, 0.8}, yaw, Material::kMetal, kFine, light);
    clear_box(centre + R * Vec3(0, 0.01, 0.12 * k), {0.8, 0.015, 0.015}, yaw, Material::kMetal, kFine, light);
  }
}

void WorldBuilder::movers(int count, double floor_z, const Bounds& b) {
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

void WorldBuilder::wall(const Vec3& centre, const Vec3& e_u, const Vec3& e_v, double size_u, double size_v,
                        double patch_m, Materials materials, double texels_per_m, double light) {
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

void WorldBuilder::shell(const Bounds& b, double patch_m, Materials walls, Materials floor, Materials ceiling,
                         double light) {
  const Vec3 c = b.centre(), s = b.size();
  const Vec3 x = Vec3::UnitX(), y = Vec3::UnitY(), z = Vec3::UnitZ();
  wall({b.low.x(), c.y(), c.z()}, y, z, s.y(), s.z(), patch_m, walls, kUsual, light);
  wall({b.high.x(), c.y(), c.z()}, -y, z, s.y(), s.z(), patch_m, walls, kUsual, light);
  wall({c.x(), b.low.y(), c.z()}, -x, z, s.x(), s.z(), patch_m, walls, kUsual, light);
  wall({c.x(), b.high.y(), c.z()}, x, z, s.x(), s.z(), patch_m, walls, kUsual, light);
  wall({c.x(), c.y(), b.low.z()}, x, y, s.x(), s.y(), 2 * patch_m, floor, kUsual, light);
  wall({c.x(), c.y(), b.high.z()}, y, x, s.y(), s.x(), 2 * patch_m, ceiling, kCoarse, light);
}

void WorldBuilder::clutter(const Bounds& b, int count, const Vec3& smallest, const Vec3& largest, Materials materials,
                           double light) {
  for (int i = 0; i < count; ++i) {
    Vec3 size;
    for (int k = 0; k < 3; ++k) size[k] = smallest[k] * std::pow(largest[k] / smallest[k], random_.uniform());
    const double yaw = random_.chance(0.6) ? 0.0 : uniform(-1.5, 1.5);
    const Vec3 centre(uniform(b.low.x(), b.high.x()), uniform(b.low.y(), b.high.y()), b.low.z() + size.z() / 2);
    if (!clear_box(centre, size, yaw, any(materials), random_.chance(0.5) ? kFine : kUsual, light * uniform(0.5, 1.5)))
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

void WorldBuilder::near_things(double per_place, int most, Materials materials, double light) {
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
      clear_box(at, {uniform(0.3, 1.2), uniform(0.3, 0.8), uniform(0.2, 0.8)}, yaw, Material::kMesh, uniform(800, 1600),
                light * uniform(1, 3));
    } else {
      clear_box(at, {uniform(0.02, 0.08), uniform(0.02, 0.08), uniform(0.5, 2)}, yaw, material, kFine, brightness);
    }
  }
}

std::size_t WorldBuilder::places_visited() const {
  std::set<std::array<int, 3>> cubes;
  for (const Vec3& p : path_) {
    const Vec3 cube = (p / 1.5).array().floor();
    cubes.insert({static_cast<int>(cube.x()), static_cast<int>(cube.y()), static_cast<int>(cube.z())});
  }
  return cubes.size();
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

}  // namespace epiline
