#include "pipeline/vision/pyramid.h"

#include <algorithm>
#include <array>

#include "pipeline/vision/halve.h"

namespace epiline {

Pyramid::Pyramid(int width, int height, int levels) {
  std::array<std::size_t, kMaxLevels> first_line{};
  std::size_t lines = 0;
  view_.level[0] = {nullptr, width, height, width};
  view_.levels = 1;
  for (int l = 1; l < levels; ++l) {
    const int w = view_.level[l - 1].width / 2, h = view_.level[l - 1].height / 2;
    if (std::min(w, h) < kMinHalvedWidth) break;
    const int lines_per_row = (w + 63) / 64;
    first_line[l] = lines;
    lines += static_cast<std::size_t>(lines_per_row) * h;
    view_.level[l] = {nullptr, w, h, 64 * lines_per_row};
    ++view_.levels;
  }
  memory_.resize(lines);
  for (int l = 1; l < view_.levels; ++l) {
    pixels_[l] = memory_[first_line[l]].bytes;
    view_.level[l].data = pixels_[l];
  }
}

void Pyramid::build(const ImageView& image) noexcept {
  view_.level[0] = image;
  for (int l = 1; l < view_.levels; ++l) halve(view_.level[l - 1], pixels_[l], view_.level[l].stride);
}

}  // namespace epiline
