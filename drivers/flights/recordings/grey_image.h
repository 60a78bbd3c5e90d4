#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace epiline {

/// An 8-bit grey image in memory, its rows without padding.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;

  /// What the pixels were is lost.
  void resize(int columns, int rows) {
    width = columns;
    height = rows;
    pixels.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  }
  std::uint8_t* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
};

/// Pixels that lie elsewhere.
struct GreyPixels {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0, stride = 0;
  const std::uint8_t* row(int y) const { return data + std::ptrdiff_t{y} * stride; }
};

}  // namespace epiline
