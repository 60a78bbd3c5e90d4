#pragma once
// The images of a camera that sends each as a JPEG (MJPEG), to 8-bit grey: by libjpeg, without its heap calls.
#include <cstddef>
#include <cstdint>
#include <memory>

namespace epiline {

class JpegDecoder {
 public:
  /// Of images of that size, in pixels. Takes all memory that decode() needs.
  JpegDecoder(int width, int height);
  ~JpegDecoder();
  JpegDecoder(const JpegDecoder&) = delete;
  JpegDecoder& operator=(const JpegDecoder&) = delete;

  /// Writes the image's brightness; rows of `to` begin `stride` bytes apart. False if and only if the bytes are no
  /// whole baseline JPEG of that size; `to` may have changed then. Tables that cameras leave out are those of the
  /// standard.
  bool decode(const std::uint8_t* bytes, std::size_t size, std::uint8_t* to, int stride) noexcept;

  struct Codec;

 private:
  std::unique_ptr<Codec> codec_;
};

}  // namespace epiline
