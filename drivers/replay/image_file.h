#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/replay/asl_dataset.h"
#include "drivers/replay/image_source.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Images that are files; `list` is the file that names them.
std::shared_ptr<ImageSource> image_files(std::vector<ImageFile> files, std::filesystem::path list);

/// Decodes an image that is whole in memory, in one of the usual formats, as 8-bit grey; empty if that is impossible.
cv::Mat decode_image(const std::uint8_t* bytes, std::size_t size);

/// The image as the bytes of a PNG file.
std::string png_of(const cv::Mat& grey);
std::string png_of(const Frame& frame);

/// Reads a data set's images into buffers of its own.
class ImageDecoder {
 public:
  static constexpr std::size_t kBuffers = 2;  ///< suffice a tracker that is called image by image
  explicit ImageDecoder(std::size_t buffers = kBuffers);
  ~ImageDecoder();

  /// Image `index` as 8-bit grey, in the next buffer: valid until that one's turn comes again. Fails if and only if it
  /// cannot be read whole, or has another size than the calibration.
  Result<Frame> read(std::size_t index, const AslDataset& dataset);
  /// The same in the buffer of that number.
  Result<Frame> read(std::size_t index, const AslDataset& dataset, std::size_t buffer);

 private:
  struct Buffers;
  std::unique_ptr<Buffers> buffers_;
};

}  // namespace epiline
