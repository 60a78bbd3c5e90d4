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
  kY12P,  ///< 12 bits, packed: 2 pixels in 3 bytes, likewise
  kYuyv,  ///< brightness in every second byte
  kNv12,  ///< a plane of brightness, then one of colours at a quarter of the resolution
  kYu12,  ///< a plane of brightness, then two of colours
  kRgb,   ///< three bytes: red, green, blue
  kBgr,
  // Mosaics of colour (Bayer), each in four orders, named by the first row: 8 bits, then 10, 12 and 16 as above.
  kBggr8,
  kGbrg8,
  kGrbg8,
  kRggb8,
  kBggr10,
  kGbrg10,
  kGrbg10,
  kRggb10,
  kBggr10P,
  kGbrg10P,
  kGrbg10P,
  kRggb10P,
  kBggr12,
  kGbrg12,
  kGrbg12,
  kRggb12,
  kBggr12P,
  kGbrg12P,
  kGrbg12P,
  kRggb12P,
  kBggr16,
  kGbrg16,
  kGrbg16,
  kRggb16,
  kMjpeg,  ///< each image a JPEG: see jpeg_decoder.h
  kCount
};

/// As v4l2-ctl shows the kernel's code: GREY, Y10, Y10P, YUYV, NV12, RGGB, BG10, pRAA, MJPG.
const char* to_string(PixelFormat format) noexcept;
std::optional<PixelFormat> pixel_format_named(std::string_view name) noexcept;
/// The kernel's four-character code.
std::uint32_t fourcc_of(PixelFormat format) noexcept;
/// One of ours has this code.
bool is_read(std::uint32_t fourcc) noexcept;
bool is_mosaic(std::uint32_t fourcc) noexcept;
/// What a sensor gives to a receiver that writes this format (MEDIA_BUS_FMT_...); 0: no sensor does.
std::uint32_t bus_code_of(PixelFormat format) noexcept;

/// The image begins with a plane of 8-bit brightness: it can be read where it is.
bool is_grey_in_place(PixelFormat format) noexcept;
/// A mosaic of colours: four pixels become one, of their mean brightness, so the grey image has half the width and
/// height.
bool is_mosaic(PixelFormat format) noexcept;
/// Bytes of a row that hold brightness: the least stride. Of kMjpeg 0, as of image_bytes().
std::size_t row_bytes(PixelFormat format, int width) noexcept;
/// Bytes up to the end of the last pixel, all planes.
std::size_t image_bytes(PixelFormat format, int width, int height, int stride) noexcept;

/// Writes the 8 most significant bits of each pixel's brightness; not for kMjpeg. `width`, `height`: of the camera's
/// image. Rows of `from` begin `from_stride` bytes apart, those of `to` `to_stride`; a packed row has a whole number of
/// groups, its image may be narrower.
void to_grey(PixelFormat format, const std::uint8_t* from, int from_stride, int width, int height, std::uint8_t* to,
             int to_stride) noexcept;

}  // namespace epiline
