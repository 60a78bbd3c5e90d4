#pragma once
// Finds where a camera sees the vehicle that carries it: what stays in the image although the camera turns, to and fro.
// docs/developers/vision.md#own-parts; test: tests/pipeline/vision/mask_test.cc.
#include <vector>

#include "estimator/geometry/types.h"

namespace epiline {

/// By the cells of a grid over the image.
class OwnParts {
 public:
  explicit OwnParts(int cells) : cells_(static_cast<std::size_t>(cells)) {}

  /// Whether a track says whose it is. `turned`: how far the camera's turn moves a far point from its place, px.
  static bool tells(const Vec2& turned) noexcept;
  static bool stays(const Vec2& moved) noexcept;
  /// A track of that cell stays.
  void add_vehicle(int cell, const Vec2& turned) noexcept;
  /// One moves as the others do.
  void add_world(int cell, const Vec2& turned) noexcept;
  bool is_own(int cell) const noexcept;

 private:
  /// Sums of turns, px, which fade as it turns on.
  struct Cell {
    double vehicle = 0, world = 0;
    Vec2 direction = Vec2::Zero();  ///< of those that speak of the vehicle
    void fade(double turn) noexcept;
  };
  std::vector<Cell> cells_;
};

}  // namespace epiline
