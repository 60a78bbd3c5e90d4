#pragma once
// The pixel formats of cameras that hold a grey image, and how it becomes 8-bit grey.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace epiline {

enum class PixelFormat : std::uint8_t {
  kGrey,  ///< 8 bits
  kY10,   ///< 10 bits in the low ones of 16, little-endian
  kY12,   ///< 12 bits, likewise
  kY16,   ///< 16 bits, likewise
  kY10P,  ///< 10 bits, packed: 4 pixels in 5 bytes, the last holds the low bits (MIPI CSI-2)
  kYuyv,  ///< brightness in every second byte
  kNv12,  ///< a plane of brightness, then one of colours at a quarter of the resolution
  kYu12,  ///< a plane of brightness, then two of colours
  kCount
};

/// As the kernel and v4l2-ctl call it: GREY, Y10, Y12, Y16, Y10P, YUYV, NV12, YU12.
const char* to_string(PixelFormat format) noexcept;
std::optional<PixelFormat> pixel_format_named(std::string_view name) noexcept;
/// The kernel's four-character code.
std::uint32_t fourcc_of(PixelFormat format) noexcept;
/// One of ours has this code.
bool is_read(std::uint32_t fourcc) noexcept;

/// The image begins with a plane of 8-bit brightness: it can be read where it is.
bool is_grey_in_place(PixelFormat format) noexcept;
/// Bytes of a row that hold brightness: the least stride.
std::size_t row_bytes(PixelFormat format, int width) noexcept;
/// Bytes up to the end of the last pixel, all planes.
std::size_t image_bytes(PixelFormat format, int width, int height, int stride) noexcept;

/// Writes the 8 most significant bits of each pixel's brightness. Rows of `from` begin `from_stride` bytes apart, those
/// of `to` `to_stride`; a Y10P row has a whole number of groups of 5 bytes, its image may be narrower.
void to_grey(PixelFormat format, const std::uint8_t* from, int from_stride, int width, int height, std::uint8_t* to,
             int to_stride) noexcept;

}  // namespace epiline
