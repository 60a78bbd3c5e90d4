#pragma once
#include <cstddef>

#include "drivers/flights/recordings/grey_image.h"
#include "platform/error/result.h"

namespace epiline {

/// The images of a recorded flight, read one at a time when they are needed.
class ImageSource {
 public:
  ImageSource() = default;
  virtual ~ImageSource() = default;
  ImageSource(const ImageSource&) = delete;
  ImageSource& operator=(const ImageSource&) = delete;

  /// Image `index` in the recording's order as 8-bit grey. Fails if and only if it cannot be read whole.
  virtual Status read(std::size_t index, GreyImage& grey) = 0;
  /// An error about that image, which names its file or message, with `found` and `expected`.
  virtual Error complaint(std::size_t index, std::string found, std::string expected) const = 0;
};

}  // namespace epiline
