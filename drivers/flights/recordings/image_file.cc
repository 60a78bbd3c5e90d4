#include "drivers/flights/recordings/image_file.h"

#include <fstream>

#include "drivers/flights/recordings/image_codecs.h"

namespace epiline {

namespace {

class ImageFiles final : public ImageSource {
 public:
  ImageFiles(std::vector<ImageFile> files, std::filesystem::path list)
      : files_(std::move(files)), list_(std::move(list)) {}
  Error complaint(std::size_t index, std::string found, std::string expected) const override {
    const ImageFile& file = files_[index];
    return {ErrorKind::kUsage, list_.string(), file.line, file.path.string() + " " + std::move(found),
            std::move(expected)};
  }

 private:
  std::size_t count() const override { return files_.size(); }
  Status decode(std::size_t index, GreyImage& grey) override {
    std::error_code ignored;
    if (!std::filesystem::exists(files_[index].path, ignored))
      return complaint(index, "does not exist", "the image that the list names");
    if (!read_bytes(files_[index].path) || !decode_image(bytes_.data(), bytes_.size(), grey))
      return complaint(index, bytes_.empty() ? "is empty" : "is damaged, cut or no image",
                       "a complete PNG, JPEG or binary PGM");
    return Done{};
  }
  bool read_bytes(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::streamoff size = file.tellg();
    if (!file || size < 0) return false;
    bytes_.resize(static_cast<std::size_t>(size));
    file.seekg(0);
    return static_cast<bool>(file.read(reinterpret_cast<char*>(bytes_.data()), size));
  }

  std::vector<ImageFile> files_;
  std::filesystem::path list_;
  std::vector<std::uint8_t> bytes_;  ///< of the file that was read last
};

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

}  // namespace

Result<Frame> ImageDecoder::read(std::size_t index, const AslDataset& dataset, std::size_t buffer) {
  GreyImage& image = buffers_[buffer];
  if (const Status s = dataset.image_source->read(index, image); !s) {
    unreadable_.add(s.error());
    return Frame{dataset.images[index].stamp};
  }
  const CameraParameters& camera = dataset.camera.parameters;
  if (image.width != camera.width || image.height != camera.height) {
    return dataset.image_source->complaint(index, "has " + size_text(image.width, image.height) + " pixels",
                                           size_text(camera.width, camera.height) + " as in the calibration");
  }
  return Frame{dataset.images[index].stamp, count_++, image.pixels.data(), image.width, image.height, image.width};
}

std::shared_ptr<ImageSource> image_files(std::vector<ImageFile> files, std::filesystem::path list) {
  return std::make_shared<ImageFiles>(std::move(files), std::move(list));
}

}  // namespace epiline
