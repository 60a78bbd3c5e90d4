// MJPEG as cameras send it, against OpenCV.
#include "drivers/sensors/camera/jpeg_decoder.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>  // before jpeglib.h, which needs FILE
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include <jpeglib.h>

#include "platform/memory/allocation_count.h"

namespace epiline {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Waves of colour with some noise.
cv::Mat picture(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  cv::RNG random(7);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) =
          cv::Vec3b(static_cast<std::uint8_t>(128 + 90 * std::sin(0.05 * x) + random.uniform(-8, 8)),
                    static_cast<std::uint8_t>(128 + 90 * std::sin(0.07 * y)),
                    static_cast<std::uint8_t>(128 + 90 * std::sin(0.03 * (x + y))));
  return image;
}

struct Kind {
  int across = 2, down = 1;  ///< pixels that share a colour; USB cameras mostly send 2 x 1
  bool is_progressive = false;
};

/// OpenCV cannot say how many pixels share a colour.
Bytes jpeg(cv::Mat image, Kind kind = {}) {
  jpeg_compress_struct library{};
  jpeg_error_mgr errors{};
  library.err = jpeg_std_error(&errors);
  jpeg_create_compress(&library);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&library, &bytes, &size);
  library.image_width = static_cast<JDIMENSION>(image.cols);
  library.image_height = static_cast<JDIMENSION>(image.rows);
  library.input_components = image.channels();
  library.in_color_space = image.channels() == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&library);
  jpeg_set_quality(&library, 85, TRUE);
  if (image.channels() == 3) {
    library.comp_info[0].h_samp_factor = kind.across;
    library.comp_info[0].v_samp_factor = kind.down;
  }
  if (kind.is_progressive) jpeg_simple_progression(&library);
  jpeg_start_compress(&library, TRUE);
  while (library.next_scanline < library.image_height) {
    JSAMPROW row = image.ptr(static_cast<int>(library.next_scanline));
    jpeg_write_scanlines(&library, &row, 1);
  }
  jpeg_finish_compress(&library);
  jpeg_destroy_compress(&library);
  const Bytes result(bytes, bytes + size);
  std::free(bytes);
  return result;
}

/// Without the segments of Huffman's tables, as many cameras send it.
Bytes without_tables(const Bytes& from) {
  Bytes to(from.begin(), from.begin() + 2);
  std::size_t at = 2;
  while (at + 4 < from.size() && from[at] == 0xff && from[at + 1] != 0xda) {
    const std::size_t length = 2 + (from[at + 2] << 8 | from[at + 3]);
    if (from[at + 1] != 0xc4)
      to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(at),
                from.begin() + static_cast<std::ptrdiff_t>(at + length));
    at += length;
  }
  to.insert(to.end(), from.begin() + static_cast<std::ptrdiff_t>(at), from.end());
  return to;
}

struct Decoder {
  int width, height, stride = width + 5;
  JpegDecoder decoder{width, height};
  Bytes grey = Bytes(static_cast<std::size_t>(stride * height), 0xa5);
  bool decode(const Bytes& bytes) { return decoder.decode(bytes.data(), bytes.size(), grey.data(), stride); }
  /// Largest difference; bytes beyond the rows must be as they were.
  int off(const cv::Mat& expected) const {
    int most = 0;
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* row = grey.data() + static_cast<std::ptrdiff_t>(y) * stride;
      for (int x = 0; x < width; ++x) most = std::max(most, std::abs(row[x] - expected.at<std::uint8_t>(y, x)));
      EXPECT_TRUE(std::all_of(row + width, row + stride, [](std::uint8_t b) { return b == 0xa5; }));
    }
    return most;
  }
};

TEST(JpegDecoder, ShowsWhatOpenCvShows) {
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(17, 9), cv::Size(640, 480), cv::Size(1280, 720), cv::Size(4096, 16)}) {
    const cv::Mat image = picture(size.width, size.height);
    for (const Kind kind : {Kind{1, 1}, Kind{2, 1}, Kind{2, 2}, Kind{1, 2}}) {
      SCOPED_TRACE(std::to_string(size.width) + ": " + std::to_string(kind.across) + " x " + std::to_string(kind.down));
      const Bytes bytes = jpeg(image, kind);
      Decoder decoder{size.width, size.height};
      ASSERT_TRUE(decoder.decode(bytes));
      EXPECT_EQ(decoder.off(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE)), 0);
    }
    cv::Mat grey;
    cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
    Decoder decoder{size.width, size.height};
    ASSERT_TRUE(decoder.decode(jpeg(grey)));
    EXPECT_LE(decoder.off(grey), 40) << "what JPEG loses of it";
  }
}

TEST(JpegDecoder, TablesThatAreLeftOutAreTheStandards) {
  const Bytes whole = jpeg(picture(320, 240)), bytes = without_tables(whole);
  ASSERT_LT(bytes.size() + 300, whole.size());
  Decoder decoder{320, 240};
  ASSERT_TRUE(decoder.decode(bytes));
  EXPECT_EQ(decoder.off(cv::imdecode(whole, cv::IMREAD_GRAYSCALE)), 0);
}

TEST(JpegDecoder, NoHeapCall) {
  const cv::Mat image = picture(640, 480);
  const Bytes whole = jpeg(image), bytes = without_tables(whole), progressive = jpeg(image, {2, 1, true});
  const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2));
  Decoder decoder{640, 480};
  const HeapCallScope heap;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(decoder.decode(i % 2 == 0 ? whole : bytes));
    ASSERT_FALSE(decoder.decode(i % 2 == 0 ? cut : progressive));
  }
  EXPECT_EQ(heap.calls(), 0u);
}

TEST(JpegDecoder, TakesOnlyWholeImagesOfItsSize) {
  const Bytes bytes = jpeg(picture(64, 48));
  Decoder decoder{64, 48};
  EXPECT_FALSE(decoder.decode({}));
  EXPECT_FALSE(decoder.decode(jpeg(picture(64, 56))));
  EXPECT_FALSE(decoder.decode(jpeg(picture(56, 48))));
  EXPECT_FALSE(decoder.decode(jpeg(picture(64, 48), {2, 1, true})));
  for (std::size_t length = 0; length + 2 < bytes.size(); ++length)  // the last two bytes say only that it ends
    ASSERT_FALSE(decoder.decode(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)))) << length;
  EXPECT_TRUE(decoder.decode(bytes)) << "after all of these";
  EXPECT_EQ(decoder.off(cv::imdecode(bytes, cv::IMREAD_GRAYSCALE)), 0);
}

RC_GTEST_PROP(JpegDecoder, AnyDamageIsSurvived, ()) {
  static const Bytes whole = jpeg(picture(64, 48));
  Decoder decoder{64, 48};
  for (int i = 0; i < 20; ++i) {
    Bytes bytes = whole;
    for (int n = *rc::gen::inRange(1, 20); n > 0; --n)
      bytes[*rc::gen::inRange<std::size_t>(0, bytes.size())] = *rc::gen::arbitrary<std::uint8_t>();
    decoder.decode(bytes);
    RC_ASSERT(decoder.decode(whole));
  }
}

}  // namespace
}  // namespace epiline
