#pragma once
// Where a camera sees the world and not the vehicle that carries it. docs/camera.md#parts-of-the-vehicle-in-view.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "pipeline/vision/corner.h"
#include "pipeline/vision/image_view.h"

namespace epiline {

/// Made once, from a picture of the camera's size: pixels below 128 are black. A patch that touches a black pixel at
/// the finest level of the pyramid is left out, so black grows by half a patch here.
class Mask {
 public:
  explicit Mask(const ImageView& picture);

  int width() const { return width_; }
  int height() const { return height_; }
  bool sees_anything() const;
  /// Whether no pixel of the patch around this place is black; false outside the image.
  bool sees(float x, float y) const noexcept {
    const long column = std::lround(x), row = std::lround(y);
    return column >= 0 && row >= 0 && column < width_ && row < height_ && at(column, row) != 0;
  }
  /// The largest rectangle of the cell that sees the world, with even sides; they are 0 if there is none.
  Cell seen_part(const Cell& cell) const;

 private:
  std::uint8_t at(long column, long row) const { return seen_[static_cast<std::size_t>(row * width_ + column)]; }

  int width_, height_;
  std::vector<std::uint8_t> seen_;  ///< by pixel, row by row: 1 or 0
};

}  // namespace epiline
