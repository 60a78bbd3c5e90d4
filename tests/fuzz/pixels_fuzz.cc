// Any bytes as a camera's image in any format: the first three bytes choose format and size, the others are repeated
// until the image is full. Reads no byte behind the image, and writes just the grey one.
#include <cstdint>
#include <vector>

#include "drivers/sensors/camera/pixel_format.h"

using namespace epiline;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) return 0;
  const auto format = static_cast<PixelFormat>(data[0] % static_cast<int>(PixelFormat::kMjpeg));
  const int width = 2 * (1 + data[1] % 64), height = 2 * (1 + data[2] % 16);
  const auto stride = static_cast<int>(row_bytes(format, width)) + data[3] % 8;
  std::vector<std::uint8_t> image(image_bytes(format, width, height, stride));
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = data[3 + i % (size - 3)];
  const int part = is_mosaic(format) ? 2 : 1;
  const int grey_width = width / part, grey_height = height / part;
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(grey_width) * static_cast<std::size_t>(grey_height));
  to_grey(format, image.data(), stride, width, height, grey.data(), grey_width);
  return 0;
}
