#include "drivers/replay/image_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

namespace epiline {

namespace {

/// The image libraries print their complaints to stderr; ours is the only line there.
class QuietStderr {
 public:
  QuietStderr() : saved_(dup(STDERR_FILENO)), nowhere_(open("/dev/null", O_WRONLY | O_CLOEXEC)) {
    if (saved_ >= 0 && nowhere_ >= 0) dup2(nowhere_, STDERR_FILENO);
  }
  ~QuietStderr() {
    if (saved_ >= 0) {
      dup2(saved_, STDERR_FILENO);
      close(saved_);
    }
    if (nowhere_ >= 0) close(nowhere_);
  }
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;

 private:
  int saved_, nowhere_;
};

template <class Decode>
cv::Mat quietly(Decode decode) {
  const QuietStderr quiet;
  try {
    return decode();
  } catch (const cv::Exception&) {
    return {};
  }
}

class ImageFiles final : public ImageSource {
 public:
  ImageFiles(std::vector<ImageFile> files, std::filesystem::path list)
      : files_(std::move(files)), list_(std::move(list)) {}
  Status read(std::size_t index, cv::Mat& grey) override {
    grey = quietly([&] { return cv::imread(files_[index].path.string(), cv::IMREAD_GRAYSCALE); });
    if (grey.empty()) return complaint(index, "cannot be read as an image", "a complete PNG, PGM, JPEG, ...");
    return Done{};
  }
  Error complaint(std::size_t index, std::string found, std::string expected) const override {
    const ImageFile& file = files_[index];
    return {ErrorKind::kUsage, list_.string(), file.line, file.path.string() + " " + std::move(found),
            std::move(expected)};
  }

 private:
  std::vector<ImageFile> files_;
  std::filesystem::path list_;
};

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

}  // namespace

struct ImageDecoder::Buffers {
  std::vector<cv::Mat> images;
  std::uint64_t count = 0;
};

ImageDecoder::ImageDecoder(std::size_t buffers) : buffers_(std::make_unique<Buffers>()) {
  buffers_->images.resize(buffers);
}
ImageDecoder::~ImageDecoder() = default;

Result<Frame> ImageDecoder::read(std::size_t index, const AslDataset& dataset) {
  return read(index, dataset, buffers_->count % buffers_->images.size());
}

Result<Frame> ImageDecoder::read(std::size_t index, const AslDataset& dataset, std::size_t buffer) {
  cv::Mat& image = buffers_->images[buffer];
  if (const Status s = dataset.image_source->read(index, image); !s) return s.error();
  const CameraParameters& camera = dataset.camera.parameters;
  if (image.cols != camera.width || image.rows != camera.height) {
    return dataset.image_source->complaint(index, "has " + size_text(image.cols, image.rows) + " pixels",
                                           size_text(camera.width, camera.height) + " as in the calibration");
  }
  return Frame{dataset.images[index].stamp, buffers_->count++, image.data, image.cols, image.rows,
               static_cast<int>(image.step)};
}

std::shared_ptr<ImageSource> image_files(std::vector<ImageFile> files, std::filesystem::path list) {
  return std::make_shared<ImageFiles>(std::move(files), std::move(list));
}

std::string png_of(const cv::Mat& grey) {
  // The fastest setting: noise does not compress.
  const std::vector<int> how{cv::IMWRITE_PNG_COMPRESSION, 1, cv::IMWRITE_PNG_STRATEGY,
                             cv::IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY};
  std::vector<unsigned char> png;
  cv::imencode(".png", grey, png, how);
  return {png.begin(), png.end()};
}

std::string png_of(const Frame& frame) {
  return png_of(cv::Mat(frame.height, frame.width, CV_8U, const_cast<std::uint8_t*>(frame.data),
                        static_cast<std::size_t>(frame.stride)));
}

cv::Mat decode_image(const std::uint8_t* bytes, std::size_t size) {
  if (size == 0 || size > (std::size_t{1} << 30)) return {};
  const cv::Mat whole(1, static_cast<int>(size), CV_8U, const_cast<std::uint8_t*>(bytes));
  return quietly([&] { return cv::imdecode(whole, cv::IMREAD_GRAYSCALE); });
}

}  // namespace epiline
