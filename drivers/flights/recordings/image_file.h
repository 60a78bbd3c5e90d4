#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/grey_image.h"
#include "drivers/flights/recordings/image_source.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Images that are files; `list` is the file that names them.
std::shared_ptr<ImageSource> image_files(std::vector<ImageFile> files, std::filesystem::path list);

/// Reads a data set's images into buffers of its own.
class ImageDecoder {
 public:
  static constexpr std::size_t kBuffers = 2;  ///< suffice a tracker that is called image by image
  explicit ImageDecoder(std::size_t buffers = kBuffers) : buffers_(buffers) {}

  /// Image `index` as 8-bit grey, in the next buffer: valid until that one's turn comes again. One that cannot be read
  /// whole is counted and has no data. Fails if and only if it has another size than the calibration.
  Result<Frame> read(std::size_t index, const AslDataset& dataset) {
    return read(index, dataset, count_ % buffers_.size());
  }
  /// The same in the buffer of that number.
  Result<Frame> read(std::size_t index, const AslDataset& dataset, std::size_t buffer);
  const UnreadableImages& unreadable() const { return unreadable_; }

 private:
  std::vector<GreyImage> buffers_;
  std::uint64_t count_ = 0;
  UnreadableImages unreadable_;
};

}  // namespace epiline
