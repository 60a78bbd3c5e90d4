#pragma once
#include <memory>

#include "drivers/replay/asl_dataset.h"

namespace epiline {

/// Decodes images one after the other. The pixels of an image stay valid until the second next call: the tracker needs
/// two.
class ImageDecoder {
 public:
  ImageDecoder();
  ~ImageDecoder();

  /// The image as 8-bit grey. Fails if and only if the file is no image that can be read whole, or has another size
  /// than the calibration.
  Result<Frame> read(const ImageFile& file, const AslDataset& dataset);

 private:
  struct Buffers;
  std::unique_ptr<Buffers> buffers_;
};

}  // namespace epiline
