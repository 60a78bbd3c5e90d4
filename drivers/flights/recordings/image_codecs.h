#pragma once
// Image files in memory to and from 8-bit grey. Of 16 bits the upper eight of those used count; of colours the luma of
// ITU-R BT.601.
#include <cstddef>
#include <cstdint>
#include <string>

#include "drivers/flights/recordings/grey_image.h"

namespace epiline {

inline constexpr int kLargestImage = 1 << 15;  ///< pixels in a row or a column

/// Each decodes a whole image into `image`, whose memory is used again. False if and only if the bytes are no complete
/// image of that format, or one larger than kLargestImage; `image` may have changed then.
bool decode_png(const std::uint8_t* bytes, std::size_t size, GreyImage& image);
bool decode_jpeg(const std::uint8_t* bytes, std::size_t size, GreyImage& image);
bool decode_pgm(const std::uint8_t* bytes, std::size_t size, GreyImage& image);  ///< binary: P5
/// The format is known by the first bytes.
bool decode_image(const std::uint8_t* bytes, std::size_t size, GreyImage& image);

/// The image as the bytes of a file. Noise does not compress, so PNG is written the fastest way. Empty if memory is
/// short.
std::string png_of(const GreyPixels& image);
/// `quality`: 1 to 100.
std::string jpeg_of(const GreyPixels& image, int quality);

}  // namespace epiline
