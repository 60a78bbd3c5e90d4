#pragma once
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace epiline {

/// An 8-bit grey image in memory, its rows without padding.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  int used_bits = 16;    ///< of values of 16 bits, at least 8: the upper eight of them become the grey
  unsigned highest = 0;  ///< of the values of 16 bits that were decoded; 0: they had 8

  /// What the pixels were is lost.
  void resize(int columns, int rows) {
    width = columns;
    height = rows;
    pixels.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  }
  /// Of a value of 16 bits.
  std::uint8_t grey_of(unsigned value) {
    highest = std::max(highest, value);
    return static_cast<std::uint8_t>(std::min(value >> (used_bits - 8), 255U));
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
