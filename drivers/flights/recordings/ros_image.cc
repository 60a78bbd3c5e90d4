#include "drivers/flights/recordings/ros_image.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "drivers/flights/recordings/image_codecs.h"

namespace epiline {

namespace {

enum class Layout : std::uint8_t { kBytes, kWords, kColours, kMosaic, kWideMosaic };

struct RosPixels {
  std::string_view name;
  int bytes;  ///< of a pixel; of a plane of brightness with others behind it, its own
  Layout layout;
  int at = 0;  ///< of brightness, or of red, among them
};
constexpr std::array<RosPixels, 24> kRosPixels{{
    {"mono8", 1, Layout::kBytes},
    {"8UC1", 1, Layout::kBytes},
    {"mono16", 2, Layout::kWords},
    {"16UC1", 2, Layout::kWords},
    {"bgr8", 3, Layout::kColours, 2},
    {"8UC3", 3, Layout::kColours, 2},
    {"rgb8", 3, Layout::kColours, 0},
    {"bgra8", 4, Layout::kColours, 2},
    {"8UC4", 4, Layout::kColours, 2},
    {"rgba8", 4, Layout::kColours, 0},
    {"bayer_rggb8", 1, Layout::kMosaic},
    {"bayer_bggr8", 1, Layout::kMosaic},
    {"bayer_gbrg8", 1, Layout::kMosaic},
    {"bayer_grbg8", 1, Layout::kMosaic},
    {"bayer_rggb16", 2, Layout::kWideMosaic},
    {"bayer_bggr16", 2, Layout::kWideMosaic},
    {"bayer_gbrg16", 2, Layout::kWideMosaic},
    {"bayer_grbg16", 2, Layout::kWideMosaic},
    {"yuv422", 2, Layout::kBytes, 1},
    {"uyvy", 2, Layout::kBytes, 1},
    {"yuv422_yuy2", 2, Layout::kBytes, 0},
    {"yuyv", 2, Layout::kBytes, 0},
    {"nv21", 1, Layout::kBytes},
    {"nv24", 1, Layout::kBytes},
}};

std::string names_of_encodings() {
  std::string names;
  for (const RosPixels& pixels : kRosPixels) names.append(names.empty() ? "" : ", ").append(pixels.name);
  return names;
}

void row_to_grey(const RosPixels& pixels, const std::uint8_t* row, bool big_endian, int y, GreyImage& grey) {
  const int red = pixels.at, high = big_endian ? 0 : 1;
  std::uint8_t* const out = grey.row(y);
  for (int x = 0; x < grey.width; ++x, row += pixels.bytes) {
    if (pixels.layout == Layout::kBytes) out[x] = row[pixels.at];
    if (pixels.layout == Layout::kWords) out[x] = grey.grey_of(unsigned{row[high]} << 8 | row[1 - high]);
    if (pixels.layout == Layout::kColours)
      out[x] = static_cast<std::uint8_t>((4899 * row[red] + 9617 * row[1] + 1868 * row[2 - red] + 8192) >> 14);
  }
}

/// 1 2 1 in both directions; beyond the edge, the pixel of the same colour on the other side.
void mosaic_to_grey(const RosPixels& pixels, const RosImage& image, GreyImage& grey) {
  const int high = image.big_endian ? 0 : 1, bits = pixels.layout == Layout::kWideMosaic ? grey.used_bits - 8 : 0;
  const auto value = [&](const std::uint8_t* row, int x) {
    if (pixels.layout == Layout::kMosaic) return unsigned{row[x]};
    const unsigned wide = unsigned{row[2 * x + high]} << 8 | row[2 * x + 1 - high];
    grey.highest = std::max(grey.highest, wide);
    return wide;
  };
  const auto inside = [](int i, int count) { return i < 0 ? -i : i < count ? i : 2 * count - 2 - i; };
  for (int y = 0; y < grey.height; ++y) {
    const auto row = [&](int i) { return image.data.data() + std::size_t{image.step} * static_cast<std::size_t>(i); };
    const std::uint8_t *above = row(inside(y - 1, grey.height)), *at = row(y), *below = row(inside(y + 1, grey.height));
    const auto column = [&](int x) { return value(above, x) + 2 * value(at, x) + value(below, x); };
    std::uint8_t* out = grey.row(y);
    for (int x = 0; x < grey.width; ++x) {
      const unsigned sum = column(inside(x - 1, grey.width)) + 2 * column(x) + column(inside(x + 1, grey.width));
      out[x] = static_cast<std::uint8_t>(std::min(sum >> (4 + bits), 255U));
    }
  }
}

}  // namespace

std::optional<ImageFault> to_grey(const RosImage& image, GreyImage& grey) {
  const auto* const pixels =
      std::find_if(kRosPixels.begin(), kRosPixels.end(), [&](const RosPixels& p) { return p.name == image.encoding; });
  if (pixels == kRosPixels.end())
    return ImageFault{"has the encoding \"" + image.encoding + "\"", names_of_encodings()};
  const bool is_mosaic = pixels->layout == Layout::kMosaic || pixels->layout == Layout::kWideMosaic;
  const std::uint32_t least = is_mosaic ? 2 : 1;
  const bool sizes =
      image.width >= least && image.height >= least && image.width <= kLargestImage && image.height <= kLargestImage;
  if (!sizes || image.step < image.width * static_cast<std::uint32_t>(pixels->bytes)) {
    return ImageFault{"has " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                          " pixels in rows of " + std::to_string(image.step) + " bytes",
                      "rows at least as long as their pixels"};
  }
  grey.resize(static_cast<int>(image.width), static_cast<int>(image.height));
  grey.highest = 0;
  if (is_mosaic) {
    mosaic_to_grey(*pixels, image, grey);
  } else {
    for (std::uint32_t y = 0; y < image.height; ++y)
      row_to_grey(*pixels, image.data.data() + std::size_t{y} * image.step, image.big_endian, static_cast<int>(y),
                  grey);
  }
  return std::nullopt;
}

bool is_depth(const std::string& encoding) {
  return encoding == "16UC1" || encoding == "32FC1" || encoding.find("compressedDepth") != std::string::npos;
}

}  // namespace epiline
