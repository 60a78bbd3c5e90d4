#include "pipeline/vision/own_parts.h"

#include <cmath>

namespace epiline {

namespace {
constexpr double kLeastTurn_px = 3, kMostMove_px = 0.5;
// Where the world is seen, less than 20 px come together on any flight that was tried.
constexpr double kEnough_px = 100;
constexpr double kFaded_px = 1000;  // so much later a look counts for a third
constexpr double kOneWay = 0.7;     // what a vehicle circles stays in the image, too, but it turns one way only
}  // namespace

bool OwnParts::tells(const Vec2& turned) noexcept { return turned.norm() >= kLeastTurn_px; }

bool OwnParts::stays(const Vec2& moved) noexcept { return moved.norm() < kMostMove_px; }

void OwnParts::Cell::fade(double turn) noexcept {
  const double kept = std::exp(-turn / kFaded_px);
  vehicle *= kept;
  world *= kept;
  direction *= kept;
}

void OwnParts::add_vehicle(int cell, const Vec2& turned) noexcept {
  Cell& c = cells_[static_cast<std::size_t>(cell)];
  c.fade(turned.norm());
  c.vehicle += turned.norm();
  c.direction += turned;
}

void OwnParts::add_world(int cell, const Vec2& turned) noexcept {
  Cell& c = cells_[static_cast<std::size_t>(cell)];
  c.fade(turned.norm());
  c.world += turned.norm();
}

bool OwnParts::is_own(int cell) const noexcept {
  const Cell& c = cells_[static_cast<std::size_t>(cell)];
  return c.vehicle > kEnough_px && c.world < c.vehicle && c.direction.norm() < kOneWay * c.vehicle;
}

}  // namespace epiline
