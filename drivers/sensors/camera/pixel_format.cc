#include "drivers/sensors/camera/pixel_format.h"

#include <linux/media-bus-format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace epiline {

namespace {

// A row each; compilers make SIMD of all but the packed ones.

unsigned word(const std::uint8_t* from) noexcept { return from[0] | static_cast<unsigned>(from[1]) << 8; }

template <int Shift>
void words_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x) to[x] = static_cast<std::uint8_t>(word(from + 2 * x) >> Shift);
}

void bytes_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  std::memcpy(to, from, static_cast<std::size_t>(width));
}

void yuyv_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x) to[x] = from[2 * x];
}

/// Luma of ITU-R BT.601, in 256ths.
template <int Red, int Blue>
void colours_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x, from += 3)
    to[x] = static_cast<std::uint8_t>((77 * from[Red] + 150 * from[1] + 29 * from[Blue] + 128) >> 8);
}

/// Groups of that many high bytes and one of low bits.
template <int Together>
void packed_to_grey(const std::uint8_t* from, int width, std::uint8_t* to) noexcept {
  int x = 0;
  for (; x + Together <= width; x += Together, from += Together + 1) std::memcpy(to + x, from, Together);
  for (; x < width; ++x) to[x] = *from++;
}

// Of mosaics: two rows to one, a mean of four pixels, rounded. `width`: of the grey row.

void bytes_of_mosaic(const std::uint8_t* upper, const std::uint8_t* lower, int width, std::uint8_t* to) noexcept {
  for (int x = 0; x < width; ++x)
    to[x] = static_cast<std::uint8_t>((upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
}

template <int Bits>
void words_of_mosaic(const std::uint8_t* upper, const std::uint8_t* lower, int width, std::uint8_t* to) noexcept {
  constexpr int kShift = Bits - 8 + 2;
  for (int x = 0; x < width; ++x) {
    const unsigned sum = word(upper + 4 * x) + word(upper + 4 * x + 2) + word(lower + 4 * x) + word(lower + 4 * x + 2);
    to[x] = static_cast<std::uint8_t>(std::min((sum + (1U << (kShift - 1))) >> kShift, 255U));
  }
}

/// Of the high bytes: what the low bits would add is below the noise of four pixels.
template <int Together>
void packed_of_mosaic(const std::uint8_t* upper, const std::uint8_t* lower, int width, std::uint8_t* to) noexcept {
  constexpr int kPairs = Together / 2;
  for (int x = 0; x < width; x += kPairs, upper += Together + 1, lower += Together + 1)
    bytes_of_mosaic(upper, lower, std::min(kPairs, width - x), to + x);
}

/// How the bytes of a row hold brightness: so many pixels in so many bytes, and how they become grey. `mosaic`: null if
/// no mosaic has such rows. A JPEG has no rows.
struct Row {
  std::size_t pixels, bytes;
  void (*grey)(const std::uint8_t* from, int width, std::uint8_t* to) noexcept;
  void (*mosaic)(const std::uint8_t* upper, const std::uint8_t* lower, int width, std::uint8_t* to) noexcept = nullptr;
};
constexpr Row kBytes{1, 1, bytes_to_grey, bytes_of_mosaic}, kWords10{1, 2, words_to_grey<2>, words_of_mosaic<10>},
    kWords12{1, 2, words_to_grey<4>, words_of_mosaic<12>}, kWords16{1, 2, words_to_grey<8>, words_of_mosaic<16>},
    kPacked10{4, 5, packed_to_grey<4>, packed_of_mosaic<4>}, kPacked12{2, 3, packed_to_grey<2>, packed_of_mosaic<2>},
    kYuyv{1, 2, yuyv_to_grey}, kRgb{1, 3, colours_to_grey<0, 2>}, kBgr{1, 3, colours_to_grey<2, 0>},
    kJpeg{1, 0, nullptr};

enum class Planes : std::uint8_t { kGrey, kGreyAndColours, kMosaic };

struct FormatFacts {
  const char* name;
  std::uint32_t fourcc;
  const Row* row;
  Planes planes = Planes::kGrey;
  std::uint32_t bus_code = 0;
};
constexpr std::array<FormatFacts, static_cast<std::size_t>(PixelFormat::kCount)> kFormats{{
    {"GREY", V4L2_PIX_FMT_GREY, &kBytes, Planes::kGrey, MEDIA_BUS_FMT_Y8_1X8},
    {"Y10", V4L2_PIX_FMT_Y10, &kWords10, Planes::kGrey, MEDIA_BUS_FMT_Y10_1X10},
    {"Y12", V4L2_PIX_FMT_Y12, &kWords12, Planes::kGrey, MEDIA_BUS_FMT_Y12_1X12},
    {"Y16", V4L2_PIX_FMT_Y16, &kWords16, Planes::kGrey, 0x202e},  // MEDIA_BUS_FMT_Y16_1X16, not in older headers
    {"Y10P", V4L2_PIX_FMT_Y10P, &kPacked10, Planes::kGrey, MEDIA_BUS_FMT_Y10_1X10},
    {"Y12P", v4l2_fourcc('Y', '1', '2', 'P'), &kPacked12, Planes::kGrey, MEDIA_BUS_FMT_Y12_1X12},
    {"YUYV", V4L2_PIX_FMT_YUYV, &kYuyv, Planes::kGrey, MEDIA_BUS_FMT_YUYV8_1X16},
    {"NV12", V4L2_PIX_FMT_NV12, &kBytes, Planes::kGreyAndColours},
    {"YU12", V4L2_PIX_FMT_YUV420, &kBytes, Planes::kGreyAndColours},
    {"RGB3", V4L2_PIX_FMT_RGB24, &kRgb, Planes::kGrey, MEDIA_BUS_FMT_RGB888_1X24},
    {"BGR3", V4L2_PIX_FMT_BGR24, &kBgr, Planes::kGrey, MEDIA_BUS_FMT_BGR888_1X24},
    {"BA81", V4L2_PIX_FMT_SBGGR8, &kBytes, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR8_1X8},
    {"GBRG", V4L2_PIX_FMT_SGBRG8, &kBytes, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG8_1X8},
    {"GRBG", V4L2_PIX_FMT_SGRBG8, &kBytes, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG8_1X8},
    {"RGGB", V4L2_PIX_FMT_SRGGB8, &kBytes, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB8_1X8},
    {"BG10", V4L2_PIX_FMT_SBGGR10, &kWords10, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR10_1X10},
    {"GB10", V4L2_PIX_FMT_SGBRG10, &kWords10, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG10_1X10},
    {"BA10", V4L2_PIX_FMT_SGRBG10, &kWords10, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG10_1X10},
    {"RG10", V4L2_PIX_FMT_SRGGB10, &kWords10, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB10_1X10},
    {"pBAA", V4L2_PIX_FMT_SBGGR10P, &kPacked10, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR10_1X10},
    {"pGAA", V4L2_PIX_FMT_SGBRG10P, &kPacked10, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG10_1X10},
    {"pgAA", V4L2_PIX_FMT_SGRBG10P, &kPacked10, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG10_1X10},
    {"pRAA", V4L2_PIX_FMT_SRGGB10P, &kPacked10, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB10_1X10},
    {"BG12", V4L2_PIX_FMT_SBGGR12, &kWords12, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR12_1X12},
    {"GB12", V4L2_PIX_FMT_SGBRG12, &kWords12, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG12_1X12},
    {"BA12", V4L2_PIX_FMT_SGRBG12, &kWords12, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG12_1X12},
    {"RG12", V4L2_PIX_FMT_SRGGB12, &kWords12, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB12_1X12},
    {"pBCC", V4L2_PIX_FMT_SBGGR12P, &kPacked12, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR12_1X12},
    {"pGCC", V4L2_PIX_FMT_SGBRG12P, &kPacked12, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG12_1X12},
    {"pgCC", V4L2_PIX_FMT_SGRBG12P, &kPacked12, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG12_1X12},
    {"pRCC", V4L2_PIX_FMT_SRGGB12P, &kPacked12, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB12_1X12},
    {"BYR2", V4L2_PIX_FMT_SBGGR16, &kWords16, Planes::kMosaic, MEDIA_BUS_FMT_SBGGR16_1X16},
    {"GB16", V4L2_PIX_FMT_SGBRG16, &kWords16, Planes::kMosaic, MEDIA_BUS_FMT_SGBRG16_1X16},
    {"GR16", V4L2_PIX_FMT_SGRBG16, &kWords16, Planes::kMosaic, MEDIA_BUS_FMT_SGRBG16_1X16},
    {"RG16", V4L2_PIX_FMT_SRGGB16, &kWords16, Planes::kMosaic, MEDIA_BUS_FMT_SRGGB16_1X16},
    {"MJPG", V4L2_PIX_FMT_MJPEG, &kJpeg},
}};

const FormatFacts& facts(PixelFormat format) noexcept { return kFormats[static_cast<std::size_t>(format)]; }

}  // namespace

const char* to_string(PixelFormat format) noexcept { return facts(format).name; }
std::uint32_t fourcc_of(PixelFormat format) noexcept { return facts(format).fourcc; }
bool is_read(std::uint32_t fourcc) noexcept {
  return std::any_of(kFormats.begin(), kFormats.end(), [&](const auto& format) { return format.fourcc == fourcc; });
}
bool is_mosaic(std::uint32_t fourcc) noexcept {
  return std::any_of(kFormats.begin(), kFormats.end(),
                     [&](const auto& format) { return format.fourcc == fourcc && format.planes == Planes::kMosaic; });
}
std::uint32_t bus_code_of(PixelFormat format) noexcept { return facts(format).bus_code; }

std::optional<PixelFormat> pixel_format_named(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kFormats.size(); ++i)
    if (name == kFormats[i].name) return static_cast<PixelFormat>(i);
  return std::nullopt;
}

bool is_grey_in_place(PixelFormat format) noexcept {
  return facts(format).row == &kBytes && facts(format).planes != Planes::kMosaic;
}

bool is_mosaic(PixelFormat format) noexcept { return facts(format).planes == Planes::kMosaic; }

std::size_t row_bytes(PixelFormat format, int width) noexcept {
  const Row& row = *facts(format).row;
  return (static_cast<std::size_t>(width) + row.pixels - 1) / row.pixels * row.bytes;
}

std::size_t image_bytes(PixelFormat format, int width, int height, int stride) noexcept {
  const auto rows = static_cast<std::size_t>(height), pitch = static_cast<std::size_t>(stride);
  if (facts(format).row == &kJpeg) return 0;
  const bool has_colour_planes = facts(format).planes == Planes::kGreyAndColours;
  return has_colour_planes ? pitch * rows + pitch * (rows / 2) : pitch * (rows - 1) + row_bytes(format, width);
}

void to_grey(PixelFormat format, const std::uint8_t* from, int from_stride, int width, int height, std::uint8_t* to,
             int to_stride) noexcept {
  const Row& row = *facts(format).row;
  const auto stride = static_cast<std::ptrdiff_t>(from_stride);
  if (is_mosaic(format)) {
    for (int y = 0; y < height / 2; ++y, from += 2 * stride, to += to_stride)
      row.mosaic(from, from + stride, width / 2, to);
    return;
  }
  for (int y = 0; y < height; ++y, from += stride, to += to_stride) row.grey(from, width, to);
}

}  // namespace epiline
