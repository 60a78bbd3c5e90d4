#include "drivers/replay/image_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

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

cv::Mat decode(const std::string& path) {
  const QuietStderr quiet;
  try {
    return cv::imread(path, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    return {};
  }
}

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

}  // namespace

struct ImageDecoder::Buffers {
  std::array<cv::Mat, 2> images;
  std::uint64_t count = 0;
};

ImageDecoder::ImageDecoder() : buffers_(std::make_unique<Buffers>()) {}
ImageDecoder::~ImageDecoder() = default;

Result<Frame> ImageDecoder::read(const ImageFile& file, const AslDataset& dataset) {
  cv::Mat& image = buffers_->images[buffers_->count % 2];
  image = decode(file.path.string());
  const auto fail = [&](std::string found, std::string expected) {
    return Error{ErrorKind::kUsage, dataset.image_list.string(), file.line, file.path.string() + " " + std::move(found),
                 std::move(expected)};
  };
  if (image.empty()) return fail("cannot be read as an image", "a complete PNG, PGM, JPEG, ...");
  const CameraParameters& camera = dataset.camera.parameters;
  if (image.cols != camera.width || image.rows != camera.height) {
    return fail("has " + size_text(image.cols, image.rows) + " pixels",
                size_text(camera.width, camera.height) + " as in the calibration");
  }
  return Frame{file.stamp, buffers_->count++, image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

}  // namespace epiline
