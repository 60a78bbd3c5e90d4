// Any bytes as an image of a camera that sends JPEGs: decoded into just its size, or refused; then the next image is
// still decoded as ever. Never a crash, never a byte beside the image.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "drivers/sensors/camera/jpeg_decoder.h"

namespace {

constexpr int kWidth = 32, kHeight = 24, kStride = 40;  // as those of the corpus
constexpr std::uint8_t kGap = 0xa5;

bool gaps_are_left(const std::vector<std::uint8_t>& image) {
  for (int row = 0; row < kHeight; ++row) {
    const auto begin = image.begin() + row * kStride;
    if (!std::all_of(begin + kWidth, begin + kStride, [](std::uint8_t byte) { return byte == kGap; })) return false;
  }
  return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static epiline::JpegDecoder decoder(kWidth, kHeight);
  std::vector<std::uint8_t> once(static_cast<std::size_t>(kStride) * kHeight, kGap), again = once;
  const bool is_image = decoder.decode(data, size, once.data(), kStride);
  if (decoder.decode(data, size, again.data(), kStride) != is_image) std::abort();
  if (!gaps_are_left(once) || (is_image && once != again)) std::abort();
  return 0;
}
