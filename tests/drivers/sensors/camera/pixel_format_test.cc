#include "drivers/sensors/camera/pixel_format.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace epiline {
namespace {

using Bytes = std::vector<std::uint8_t>;

struct Image {
  int width = *rc::gen::inRange(1, 70), height = *rc::gen::inRange(1, 9), padding = *rc::gen::inRange(0, 20);
  int stride(PixelFormat format) const { return static_cast<int>(row_bytes(format, width)) + padding; }
};

Bytes any_bytes(std::size_t count) { return *rc::gen::container<Bytes>(count, rc::gen::arbitrary<std::uint8_t>()); }

/// The conversion, with the bytes around each row of the result left alone.
Bytes converted(PixelFormat format, const Bytes& from, const Image& image) {
  const int stride = image.width + 3;
  Bytes to(static_cast<std::size_t>(stride * image.height), 0xa5);
  to_grey(format, from.data(), image.stride(format), image.width, image.height, to.data(), stride);
  Bytes pixels;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < stride; ++x) {
      const std::uint8_t value = to[static_cast<std::size_t>(y * stride + x)];
      if (x < image.width) pixels.push_back(value);
      if (x >= image.width) RC_ASSERT(value == 0xa5);
    }
  return pixels;
}

Bytes of(const cv::Mat& grey) {
  Bytes pixels;
  for (int y = 0; y < grey.rows; ++y)
    pixels.insert(pixels.end(), grey.ptr<std::uint8_t>(y), grey.ptr<std::uint8_t>(y) + grey.cols);
  return pixels;
}

// Words of 16 bits, against OpenCV's division (exact where the bits cut off are zero, so they are).
RC_GTEST_PROP(PixelFormat, WordsKeepTheirHighestBits, ()) {
  const auto [format, bits] = *rc::gen::element(std::pair{PixelFormat::kY10, 10}, std::pair{PixelFormat::kY12, 12},
                                                std::pair{PixelFormat::kY16, 16});
  const Image image;
  Bytes from = any_bytes(static_cast<std::size_t>(image.stride(format) * image.height));
  cv::Mat grey(image.height, image.width, CV_8U);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      std::uint8_t* word = &from[static_cast<std::size_t>(y * image.stride(format) + 2 * x)];
      const int value = (word[0] | word[1] << 8) & ((1 << bits) - 1);  // the kernel says: unused high bits are zero
      word[0] = static_cast<std::uint8_t>(value);
      word[1] = static_cast<std::uint8_t>(value >> 8);
      cv::Mat(1, 1, CV_16U, cv::Scalar(value - value % (1 << (bits - 8))))
          .convertTo(grey.row(y).col(x), CV_8U, 1.0 / (1 << (bits - 8)));
    }
  }
  RC_ASSERT(converted(format, from, image) == of(grey));
}

RC_GTEST_PROP(PixelFormat, YuyvIsOpenCvs, ()) {
  Image image;
  image.width += image.width % 2;
  const Bytes from = any_bytes(static_cast<std::size_t>(image.stride(PixelFormat::kYuyv) * image.height));
  const cv::Mat yuyv(image.height, image.width, CV_8UC2, const_cast<std::uint8_t*>(from.data()),
                     static_cast<std::size_t>(image.stride(PixelFormat::kYuyv)));
  cv::Mat grey;
  cv::cvtColor(yuyv, grey, cv::COLOR_YUV2GRAY_YUYV);
  RC_ASSERT(converted(PixelFormat::kYuyv, from, image) == of(grey));
}

RC_GTEST_PROP(PixelFormat, PlanesAreTakenAsTheyAre, ()) {
  const auto format = *rc::gen::element(PixelFormat::kGrey, PixelFormat::kNv12, PixelFormat::kYu12);
  const Image image;
  const Bytes from = any_bytes(static_cast<std::size_t>(image.stride(format) * image.height));
  RC_ASSERT(is_grey_in_place(format));
  Bytes expected;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      expected.push_back(from[static_cast<std::size_t>(y * image.stride(format) + x)]);
  RC_ASSERT(converted(format, from, image) == expected);
}

// Packed by the specification of MIPI CSI-2, RAW10: four high bytes, then the low bits, the first pixel's lowest.
RC_GTEST_PROP(PixelFormat, PackedPixelsAreFound, ()) {
  const Image image;
  const int stride = image.stride(PixelFormat::kY10P);
  Bytes from(static_cast<std::size_t>(stride * image.height), 0), expected;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const int value = *rc::gen::inRange(0, 1024);
      std::uint8_t* group = &from[static_cast<std::size_t>(y * stride + x / 4 * 5)];
      group[x % 4] = static_cast<std::uint8_t>(value / 4);
      group[4] = static_cast<std::uint8_t>(group[4] | (value % 4) << (2 * (x % 4)));
      expected.push_back(static_cast<std::uint8_t>(value / 4));
    }
  }
  RC_ASSERT(converted(PixelFormat::kY10P, from, image) == expected);
}

TEST(PixelFormat, SizesAreThoseOfTheKernelsDocuments) {
  EXPECT_EQ(row_bytes(PixelFormat::kY10P, 640), 800u);
  EXPECT_EQ(row_bytes(PixelFormat::kY10P, 641), 805u);
  EXPECT_EQ(image_bytes(PixelFormat::kGrey, 640, 480, 640), 640u * 480);
  EXPECT_EQ(image_bytes(PixelFormat::kGrey, 640, 480, 704), 704u * 479 + 640) << "the last row needs no padding";
  EXPECT_EQ(image_bytes(PixelFormat::kNv12, 640, 480, 640), 640u * 480 * 3 / 2);
  EXPECT_EQ(image_bytes(PixelFormat::kYuyv, 640, 480, 1280), 640u * 480 * 2);
}

TEST(PixelFormat, NamesAreThoseOfV4l2Ctl) {
  for (int i = 0; i < static_cast<int>(PixelFormat::kCount); ++i) {
    const auto format = static_cast<PixelFormat>(i);
    EXPECT_EQ(pixel_format_named(to_string(format)), format);
  }
  EXPECT_FALSE(pixel_format_named("MJPG"));
  EXPECT_EQ(fourcc_of(PixelFormat::kYu12), 0x32315559u) << "YU12";
}

}  // namespace
}  // namespace epiline
