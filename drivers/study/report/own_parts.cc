#include "drivers/study/report/own_parts.h"

#include <algorithm>
#include <vector>

#include "drivers/flights/recordings/image_codecs.h"

namespace epiline {

double own_share(const OwnCells& c) {
  const int cells = c.columns * c.rows;
  return cells > 0 ? static_cast<double>(c.own.count()) / cells : 0;
}

std::string own_parts_png(const OwnCells& c) {
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(c.image_width) * static_cast<std::size_t>(c.image_height));
  for (int y = 0; y < c.image_height; ++y)
    for (int x = 0; x < c.image_width; ++x) {
      const int column = std::clamp((x - c.border_px) / c.width_px, 0, c.columns - 1);
      const int row = std::clamp((y - c.border_px) / c.height_px, 0, c.rows - 1);
      const auto cell = static_cast<std::size_t>(row * c.columns + column);
      const bool own = cell < c.own.size() && c.own[cell];
      pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.image_width) + static_cast<std::size_t>(x)] =
          own ? 0 : 255;
    }
  return png_of({pixels.data(), c.image_width, c.image_height, c.image_width});
}

}  // namespace epiline
