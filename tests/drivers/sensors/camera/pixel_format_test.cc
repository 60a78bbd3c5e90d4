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
  const int parts = is_mosaic(format) ? 2 : 1, width = image.width / parts, height = image.height / parts;
  const int stride = width + 3;
  Bytes to(static_cast<std::size_t>(stride * image.height), 0xa5);
  to_grey(format, from.data(), image.stride(format), image.width, image.height, to.data(), stride);
  Bytes pixels;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < stride; ++x) {
      const std::uint8_t value = to[static_cast<std::size_t>(y * stride + x)];
      const bool is_inside = x < width && y < height;
      if (is_inside) pixels.push_back(value);
      if (!is_inside) RC_ASSERT(value == 0xa5);
    }
  return pixels;
}

Bytes of(const cv::Mat& grey) {
  Bytes pixels;
  for (int y = 0; y < grey.rows; ++y)
    pixels.insert(pixels.end(), grey.ptr<std::uint8_t>(y), grey.ptr<std::uint8_t>(y) + grey.cols);
  return pixels;
}

struct Colours {
  PixelFormat format;
  int type, to_grey, tolerance;
};

RC_GTEST_PROP(PixelFormat, ColoursBecomeOpenCvsLuma, ()) {
  const auto colours = *rc::gen::element(Colours{PixelFormat::kYuyv, CV_8UC2, cv::COLOR_YUV2GRAY_YUYV, 0},
                                         Colours{PixelFormat::kRgb, CV_8UC3, cv::COLOR_RGB2GRAY, 1},
                                         Colours{PixelFormat::kBgr, CV_8UC3, cv::COLOR_BGR2GRAY, 1});
  Image image;
  image.width += image.width % 2;
  const int stride = image.stride(colours.format);
  const Bytes from = any_bytes(static_cast<std::size_t>(stride * image.height));
  const cv::Mat given(image.height, image.width, colours.type, const_cast<std::uint8_t*>(from.data()),
                      static_cast<std::size_t>(stride));
  cv::Mat grey;
  cv::cvtColor(given, grey, colours.to_grey);
  const Bytes ours = converted(colours.format, from, image), theirs = of(grey);
  for (std::size_t i = 0; i < theirs.size(); ++i) RC_ASSERT(std::abs(ours[i] - theirs[i]) <= colours.tolerance);
}

/// Pixels of so many bits as a camera sends them. Packed by the specification of MIPI CSI-2, RAW10 and RAW12: high
/// bytes, then the low bits, the first pixel's lowest.
Bytes sent(PixelFormat format, int bits, bool is_packed, const cv::Mat& values, int stride) {
  Bytes bytes(static_cast<std::size_t>(stride * values.rows), 0);
  const int together = bits == 10 ? 4 : 2;
  for (int y = 0; y < values.rows; ++y) {
    std::uint8_t* const row = &bytes[static_cast<std::size_t>(y * stride)];
    for (int x = 0; x < values.cols; ++x) {
      const int value = values.at<std::uint16_t>(y, x);
      if (is_packed) {
        std::uint8_t* const group = row + x / together * (together + 1);
        group[x % together] = static_cast<std::uint8_t>(value >> (bits - 8));
        const int low = (value & ((1 << (bits - 8)) - 1)) << ((bits - 8) * (x % together));
        group[together] = static_cast<std::uint8_t>(group[together] | low);
      } else if (row_bytes(format, 1) == 1) {
        row[x] = static_cast<std::uint8_t>(value);
      } else {
        row[2 * x] = static_cast<std::uint8_t>(value);
        row[2 * x + 1] = static_cast<std::uint8_t>(value >> 8);
      }
    }
  }
  return bytes;
}

cv::Mat any_values(const Image& image, int bits) {
  cv::Mat values(image.height, image.width, CV_16U);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      values.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(*rc::gen::inRange(0, 1 << bits));
  return values;
}

struct Sent {
  PixelFormat format;  ///< of a mosaic: the first of four, in each order of colours
  int bits;
  bool is_packed = false;
};

RC_GTEST_PROP(PixelFormat, GreyKeepsItsHighestBits, ()) {
  const auto kind =
      *rc::gen::element(Sent{PixelFormat::kGrey, 8}, Sent{PixelFormat::kNv12, 8}, Sent{PixelFormat::kYu12, 8},
                        Sent{PixelFormat::kY10, 10}, Sent{PixelFormat::kY12, 12}, Sent{PixelFormat::kY16, 16},
                        Sent{PixelFormat::kY10P, 10, true}, Sent{PixelFormat::kY12P, 12, true});
  const Image image;
  const cv::Mat values = any_values(image, kind.bits);
  RC_ASSERT(is_grey_in_place(kind.format) == (kind.bits == 8));
  Bytes expected;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      expected.push_back(static_cast<std::uint8_t>(values.at<std::uint16_t>(y, x) >> (kind.bits - 8)));
  const Bytes from = sent(kind.format, kind.bits, kind.is_packed, values, image.stride(kind.format));
  RC_ASSERT(converted(kind.format, from, image) == expected);
}

// Against OpenCV's mean over areas. Packed ones leave out the low bits: less than a level.
RC_GTEST_PROP(PixelFormat, FourPixelsOfAMosaicAreOneOfTheirMean, ()) {
  const auto mosaic = *rc::gen::element(Sent{PixelFormat::kBggr8, 8}, Sent{PixelFormat::kBggr10, 10},
                                        Sent{PixelFormat::kBggr10P, 10, true}, Sent{PixelFormat::kBggr12, 12},
                                        Sent{PixelFormat::kBggr12P, 12, true}, Sent{PixelFormat::kBggr16, 16});
  const auto format = static_cast<PixelFormat>(static_cast<int>(mosaic.format) + *rc::gen::inRange(0, 4));
  Image image;
  image.width += image.width % 2;
  image.height += image.height % 2;
  RC_ASSERT(is_mosaic(format));
  RC_ASSERT(!is_grey_in_place(format));
  const cv::Mat values = any_values(image, mosaic.bits);
  const Bytes grey =
      converted(format, sent(format, mosaic.bits, mosaic.is_packed, values, image.stride(format)), image);
  cv::Mat exact, mean;
  values.convertTo(exact, CV_64F, 1.0 / (1 << (mosaic.bits - 8)));
  cv::resize(exact, mean, {image.width / 2, image.height / 2}, 0, 0, cv::INTER_AREA);
  RC_ASSERT(grey.size() == mean.total());
  for (std::size_t i = 0; i < grey.size(); ++i) {
    const double off = grey[i] - std::min(mean.at<double>(static_cast<int>(i)), 255.0);
    RC_ASSERT(off <= 0.5 && off >= (mosaic.is_packed ? -1.5 : -0.5));
  }
}

TEST(PixelFormat, SizesAreThoseOfTheKernelsDocuments) {
  EXPECT_EQ(row_bytes(PixelFormat::kY10P, 640), 800u);
  EXPECT_EQ(row_bytes(PixelFormat::kY10P, 641), 805u);
  EXPECT_EQ(row_bytes(PixelFormat::kRggb10P, 1456), 1820u);
  EXPECT_EQ(row_bytes(PixelFormat::kRggb12P, 1456), 2184u);
  EXPECT_EQ(row_bytes(PixelFormat::kRggb10, 1456), 2912u);
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
  EXPECT_FALSE(pixel_format_named("H264"));
  EXPECT_EQ(pixel_format_named("pRAA"), PixelFormat::kRggb10P);
  EXPECT_EQ(fourcc_of(PixelFormat::kYu12), 0x32315559u) << "YU12";
}

}  // namespace
}  // namespace epiline
