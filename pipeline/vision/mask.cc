#include "pipeline/vision/mask.h"

#include <algorithm>

namespace epiline {

namespace {
constexpr int kHalfPatch = 8;     // px, with what interpolation reads
constexpr int kFirstWhite = 128;  // grey values

/// Each value becomes the least of those up to kHalfPatch away, along a line of the image.
void take_least(std::uint8_t* line, int count, std::ptrdiff_t step, std::vector<std::uint8_t>& scratch) {
  scratch.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    std::uint8_t least = 1;
    for (int k = std::max(0, i - kHalfPatch); k <= std::min(count - 1, i + kHalfPatch); ++k)
      least = std::min(least, line[k * step]);
    scratch[static_cast<std::size_t>(i)] = least;
  }
  for (int i = 0; i < count; ++i) line[i * step] = scratch[static_cast<std::size_t>(i)];
}
}  // namespace

Mask::Mask(const ImageView& picture) : width_(picture.width), height_(picture.height) {
  seen_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) seen_.push_back(picture.row(y)[x] >= kFirstWhite);
  std::vector<std::uint8_t> scratch;
  for (int y = 0; y < height_; ++y) take_least(seen_.data() + std::ptrdiff_t{y} * width_, width_, 1, scratch);
  for (int x = 0; x < width_; ++x) take_least(seen_.data() + x, height_, width_, scratch);
}

bool Mask::sees_anything() const { return std::find(seen_.begin(), seen_.end(), 1) != seen_.end(); }

Cell Mask::seen_part(const Cell& cell) const {
  Cell best{cell.x, cell.y, 0, 0};
  std::vector<int> above(static_cast<std::size_t>(cell.width), 0);  // by column: white pixels that end in this row
  for (int y = 0; y < cell.height; ++y) {
    for (int x = 0; x < cell.width; ++x) {
      int& height = above[static_cast<std::size_t>(x)];
      height = at(cell.x + x, cell.y + y) != 0 ? height + 1 : 0;
    }
    for (int left = 0; left < cell.width; ++left) {
      int height = cell.height;
      for (int x = left; x < cell.width && height > 0; ++x) {
        height = std::min(height, above[static_cast<std::size_t>(x)]);
        const Cell part{cell.x + left, cell.y + y + 1 - height, (x + 1 - left) & ~1, height & ~1};
        if (part.width * part.height > best.width * best.height) best = part;
      }
    }
  }
  return best;
}

}  // namespace epiline
