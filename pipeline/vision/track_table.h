#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <utility>

#include "estimator/geometry/types.h"
#include "platform/samples/samples.h"

namespace epiline {

/// All living tracks, structure of arrays, in the order of their ids. Fixed capacity.
struct TrackTable {
  static constexpr int kCapacity = static_cast<int>(kMaxFeatures);
  static constexpr int kHistory = 8;  ///< images whose bearings are kept
  template <class T>
  using Column = std::array<T, kCapacity>;
  using Bearings = std::array<std::array<float, 3>, kHistory>;

  TrackTable() { std::iota(patch.begin(), patch.end(), 0); }

  int size = 0;
  Column<std::uint32_t> id{};
  Column<std::uint32_t> age{};               ///< images since the track began
  Column<float> x{}, y{};                    ///< px
  Column<float> velocity_x{}, velocity_y{};  ///< px/s, to the previous image
  Column<float> parallax_x{}, parallax_y{};  ///< px/s, the part of it that rotation does not explain
  Column<float> innovation{};                ///< px, between predicted and found position
  Column<Vec2> turned{};                     ///< px, by the camera's turn, of those that say whose they are; else zero
  Column<Vec3> bearing{};                    ///< unit, camera frame of the last image
  Column<Mat23> pixel_jacobian{};            ///< d px / d bearing
  Column<Bearings> history{};                ///< unit bearings; that of image n is at n % kHistory

  Column<int> patch{};  ///< place of its KLT template; those beyond `size` are free

  /// Removes the tracks whose `alive` is false; the others keep their order.
  void keep(const Column<bool>& alive) {
    const auto end = alive.begin() + size;
    const int left = static_cast<int>(std::count(alive.begin(), end, true));
    if (left == size) return;
    const auto compact = [&](auto&... columns) { (compact_column(columns, alive), ...); };
    compact(id, age, x, y, velocity_x, velocity_y, parallax_x, parallax_y, innovation, turned, bearing, pixel_jacobian,
            history);
    for (int i = 0, n = 0; i < size; ++i) {
      if (alive[i]) std::swap(patch[n++], patch[i]);
    }
    size = left;
  }

 private:
  template <class T>
  void compact_column(Column<T>& column, const Column<bool>& alive) const {
    int n = 0;
    for (int i = 0; i < size; ++i) {
      if (alive[i]) column[n++] = column[i];
    }
  }
};

}  // namespace epiline
