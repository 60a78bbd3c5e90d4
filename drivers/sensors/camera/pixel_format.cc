#include "drivers/sensors/camera/pixel_format.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace epiline {

namespace {

struct FormatFacts {
  const char* name;
  std::uint32_t fourcc;
};
constexpr std::array<FormatFacts, static_cast<std::size_t>(PixelFormat::kCount)> kFormats{{
    {"GREY", V4L2_PIX_FMT_GREY},
    {"Y10", V4L2_PIX_FMT_Y10},
    {"Y12", V4L2_PIX_FMT_Y12},
    {"Y16", V4L2_PIX_FMT_Y16},
    {"Y10P", V4L2_PIX_FMT_Y10P},
    {"YUYV", V4L2_PIX_FMT_YUYV},
    {"NV12", V4L2_PIX_FMT_NV12},
    {"YU12", V4L2_PIX_FMT_YUV420},
}};

const FormatFacts& facts(PixelFormat format) noexcept { return kFormats[static_cast<std::size_t>(format)]; }

// One row each; compilers make SIMD of the first two.

template <int Shift>
void words_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x) {
    const unsigned word = static_cast<unsigned>(from[2 * x]) | static_cast<unsigned>(from[2 * x + 1]) << 8;
    to[x] = static_cast<std::uint8_t>(word >> Shift);
  }
}

void yuyv_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x) to[x] = from[2 * x];
}

void packed_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  int x = 0;
  for (; x + 4 <= width; x += 4, from += 5) std::memcpy(to + x, from, 4);
  for (; x < width; ++x) to[x] = *from++;
}

void row_to_grey(PixelFormat format, const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  switch (format) {
    case PixelFormat::kY10:
      return words_to_grey<2>(from, width, to);
    case PixelFormat::kY12:
      return words_to_grey<4>(from, width, to);
    case PixelFormat::kY16:
      return words_to_grey<8>(from, width, to);
    case PixelFormat::kY10P:
      return packed_to_grey(from, width, to);
    case PixelFormat::kYuyv:
      return yuyv_to_grey(from, width, to);
    default:
      std::memcpy(to, from, static_cast<std::size_t>(width));
  }
}

}  // namespace

const char* to_string(PixelFormat format) noexcept { return facts(format).name; }
std::uint32_t fourcc_of(PixelFormat format) noexcept { return facts(format).fourcc; }
bool is_read(std::uint32_t fourcc) noexcept {
  return std::any_of(kFormats.begin(), kFormats.end(), [&](const auto& format) { return format.fourcc == fourcc; });
}

std::optional<PixelFormat> pixel_format_named(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kFormats.size(); ++i)
    if (name == kFormats[i].name) return static_cast<PixelFormat>(i);
  return std::nullopt;
}

bool is_grey_in_place(PixelFormat format) noexcept {
  return format == PixelFormat::kGrey || format == PixelFormat::kNv12 || format == PixelFormat::kYu12;
}

std::size_t row_bytes(PixelFormat format, int width) noexcept {
  const auto w = static_cast<std::size_t>(width);
  if (is_grey_in_place(format)) return w;
  if (format == PixelFormat::kY10P) return (w + 3) / 4 * 5;
  return 2 * w;
}

std::size_t image_bytes(PixelFormat format, int width, int height, int stride) noexcept {
  const auto rows = static_cast<std::size_t>(height), pitch = static_cast<std::size_t>(stride);
  const bool has_colour_planes = format == PixelFormat::kNv12 || format == PixelFormat::kYu12;
  return has_colour_planes ? pitch * rows + pitch * (rows / 2) : pitch * (rows - 1) + row_bytes(format, width);
}

void to_grey(PixelFormat format, const std::uint8_t* from, int from_stride, int width, int height, std::uint8_t* to,
             int to_stride) noexcept {
  for (int y = 0; y < height; ++y)
    row_to_grey(format, from + static_cast<std::ptrdiff_t>(y) * from_stride, width,
                to + static_cast<std::ptrdiff_t>(y) * to_stride);
}

}  // namespace epiline
