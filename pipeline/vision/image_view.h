#pragma once
#include <cstddef>
#include <cstdint>

namespace epiline {

/// A view of 8-bit grey pixels; it does not own them. Row y starts at data + y * stride; stride >= width, in bytes.
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0, height = 0, stride = 0;
  const std::uint8_t* row(int y) const { return data + static_cast<std::ptrdiff_t>(y) * stride; }
};

inline constexpr int kMaxLevels = 6;

/// Level 0 is the image; a pixel of level l + 1 is the mean of 2x2 pixels of level l: x_coarse = (x + 0.5) / 2 - 0.5.
struct PyramidView {
  ImageView level[kMaxLevels];
  int levels = 0;
};

}  // namespace epiline
