#include "drivers/laboratory/render/world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "drivers/laboratory/render/renderer.h"
#include "drivers/laboratory/simulate/flights.h"

namespace epiline {
namespace {

std::vector<Vec3> some_path() {
  Random random(4, 0);
  const Flight flight = make_flight(FlightKind::kAgile, random);
  std::vector<Vec3> path;
  for (double t = 0; t < flight.duration_s(); t += 0.1) path.push_back(flight.at(t).p_WB);
  return path;
}

std::string kind_name(const testing::TestParamInfo<WorldKind>& info) { return to_string(info.param); }

class EveryWorld : public testing::TestWithParam<WorldKind> {};
INSTANTIATE_TEST_SUITE_P(Worlds, EveryWorld, testing::ValuesIn(kAllWorlds), kind_name);

TEST_P(EveryWorld, IsTheSameForTheSameSeed) {
  const World a = make_world(GetParam(), some_path(), 3, 7), b = make_world(GetParam(), some_path(), 3, 7);
  const World c = make_world(GetParam(), some_path(), 3, 8);
  ASSERT_EQ(a.panels.size(), b.panels.size());
  for (std::size_t i = 0; i < a.panels.size(); ++i) ASSERT_EQ(a.panels[i].centre, b.panels[i].centre);
  EXPECT_TRUE(a.panels.size() != c.panels.size() || a.panels.back().centre != c.panels.back().centre);
  EXPECT_EQ(a.movers.size(), 3U);
}

// The axes of every panel are an orthonormal pair: a renderer relies on it.
TEST_P(EveryWorld, PanelsAreRectangles) {
  for (const Panel& p : make_world(GetParam(), some_path(), 0, 1).panels) {
    ASSERT_NEAR(p.e_u.norm(), 1, 1e-12);
    ASSERT_NEAR(p.e_v.norm(), 1, 1e-12);
    ASSERT_NEAR(p.e_u.dot(p.e_v), 0, 1e-12);
    ASSERT_GT(p.half_u, 0);
    ASSERT_GT(p.half_v, 0);
    ASSERT_GE(p.shade, 0);
  }
}

double distance(const Panel& panel, const Vec3& point) {
  const Vec3 to = point - panel.centre;
  const double u = std::max(0.0, std::abs(to.dot(panel.e_u)) - panel.half_u);
  const double v = std::max(0.0, std::abs(to.dot(panel.e_v)) - panel.half_v);
  return Vec3(u, v, to.dot(panel.normal())).norm();
}

/// The height with the largest area that faces up.
double floor_of(const World& world) {
  std::map<double, double> area;
  for (const Panel& p : world.panels)
    if (p.normal().z() > 0.999) area[p.centre.z()] += p.half_u * p.half_v;
  return std::max_element(area.begin(), area.end(), [](auto& a, auto& b) { return a.second < b.second; })->first;
}

TEST_P(EveryWorld, KeepsItsDistanceFromThePath) {
  const std::vector<Vec3> path = some_path();
  const World world = make_world(GetParam(), path, 3, 2);
  const double floor = floor_of(world);
  double lowest = path.front().z();
  for (const Vec3& p : path) lowest = std::min(lowest, p.z());
  EXPECT_GT(lowest - floor, kFloorClearance_m - 1e-9);
  for (const Panel& panel : world.panels) {
    const bool is_floor = panel.normal().z() > 0.999 && panel.centre.z() == floor;
    for (const Vec3& p : path)
      ASSERT_GT(distance(panel, p), (is_floor ? kFloorClearance_m : kWorldClearance_m) - 1e-9) << panel.centre;
  }
  for (const Mover& mover : world.movers)
    for (Panel panel : mover.panels) {
      const Vec3 at = panel.centre;
      for (double t = 0; t < mover.period_s; t += mover.period_s / 50) {
        panel.centre = mover.centre(t) + at;
        for (const Vec3& p : path) ASSERT_GT(distance(panel, p), kWorldClearance_m - 1e-9);
      }
    }
}

// Every way to look there is something or the sky; indoors there is no hole.
TEST_P(EveryWorld, SurroundsThePath) {
  const std::vector<Vec3> path = some_path();
  const World world = make_world(GetParam(), path, 0, 2);
  Random random(9, 0);
  int holes = 0, rays = 0;
  std::vector<double> depth;
  for (std::size_t i = 0; i < path.size(); i += 10) {
    for (int k = 0; k < 40; ++k) {
      const auto hit = cast_ray(world, path[i], random.normal3(1).normalized());
      ++rays;
      if (!hit) {
        ++holes;
        continue;
      }
      depth.push_back(hit->distance_m);
      ASSERT_GT(hit->distance_m, kFloorClearance_m - 1e-9);
    }
  }
  const bool is_outdoors = GetParam() == WorldKind::kOutdoor || GetParam() == WorldKind::kFields;
  if (!is_outdoors) {
    EXPECT_LT(holes, rays / 200);
  }
  std::sort(depth.begin(), depth.end());
  const double median = depth[depth.size() / 2];
  const double most = GetParam() == WorldKind::kHall ? 8 : is_outdoors ? 12 : 4;
  EXPECT_GT(median, 0.8);
  EXPECT_LT(median, most);
}

}  // namespace
}  // namespace epiline
