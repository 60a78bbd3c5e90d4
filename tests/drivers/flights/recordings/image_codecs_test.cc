// Our way with image files against OpenCV's.
#include "drivers/flights/recordings/image_codecs.h"
#include "drivers/flights/recordings/image_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <string>
#include <vector>

namespace epiline {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// A slope with noise on it.
cv::Mat picture(int type, int width = 123, int height = 57) {
  cv::Mat image(height, width, type);
  std::mt19937 random(7);
  const int depth = CV_MAT_DEPTH(type), channels = CV_MAT_CN(type);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width * channels; ++x) {
      const auto value = static_cast<unsigned>(200 * x + 300 * y) + random() % 4000;
      if (depth == CV_16U) image.ptr<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(value);
      if (depth == CV_8U) image.ptr(y)[x] = static_cast<std::uint8_t>(value >> 8);
    }
  }
  return image;
}

Bytes encoded(const char* format, const cv::Mat& image) {
  Bytes bytes;
  cv::imencode(format, image, bytes);
  return bytes;
}

void expect_same(const GreyImage& ours, const cv::Mat& theirs) {
  ASSERT_EQ(ours.width, theirs.cols);
  ASSERT_EQ(ours.height, theirs.rows);
  for (int y = 0; y < theirs.rows; ++y)
    ASSERT_TRUE(std::equal(theirs.ptr(y), theirs.ptr(y) + theirs.cols, ours.pixels.data() + y * theirs.cols)) << y;
}

void expect_as_opencv(const Bytes& bytes) {
  GreyImage image;
  ASSERT_TRUE(decode_image(bytes.data(), bytes.size(), image));
  expect_same(image, cv::imdecode(bytes, cv::IMREAD_GRAYSCALE));
}

GreyPixels pixels_of(const cv::Mat& m) { return {m.data, m.cols, m.rows, static_cast<int>(m.step)}; }

TEST(ImageCodecs, RefuseWhatIsCutShort) {
  for (const char* format : {".png", ".jpg", ".pgm"}) {
    const Bytes whole = encoded(format, picture(CV_8U));
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 97) {
      const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));  // its end is the heap's
      GreyImage image;
      EXPECT_FALSE(decode_image(part.data(), part.size(), image)) << format << " " << size << " of " << whole.size();
    }
  }
}

TEST(ImageCodecs, RefuseDamageAndOtherFormats) {
  GreyImage image;
  for (const char* text : {"P5 0 4 255 aaaa", "P5 4 4 255", "P5 99999 1 255 a", "P5 2 2 99999999999 aaaa",
                           "P2 1 1 255 7", "hello", "\x89PNG", "\xff\xd8\xff"}) {
    const std::string bytes(text);
    EXPECT_FALSE(decode_image(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size(), image)) << text;
  }
  Bytes png = encoded(".png", picture(CV_8U));
  png[png.size() / 2] ^= 0x10;  // its checksums no longer agree
  EXPECT_FALSE(decode_image(png.data(), png.size(), image));
  const Bytes bmp = encoded(".bmp", picture(CV_8U));
  EXPECT_FALSE(decode_image(bmp.data(), bmp.size(), image));
}

TEST(ImageCodecs, PngIsReadAsOpenCvReadsIt) {
  for (const int type : {CV_8U, CV_16U, CV_8UC3, CV_16UC3, CV_8UC4}) {
    SCOPED_TRACE(type);
    expect_as_opencv(encoded(".png", picture(type)));
  }
}

TEST(ImageCodecs, JpegIsReadAsOpenCvReadsIt) {
  for (const int type : {CV_8U, CV_8UC3}) {
    SCOPED_TRACE(type);
    expect_as_opencv(encoded(".jpg", picture(type)));
  }
}

TEST(ImageCodecs, PgmIsReadAsOpenCvReadsIt) {
  expect_as_opencv(encoded(".pgm", picture(CV_8U)));
  const std::string remark = "P5\n# a remark, 7 8 9\n3 2\n255\nabcdef";
  expect_as_opencv({remark.begin(), remark.end()});
  GreyImage image;
  const std::string wide = "P5 2 1 65535\n\x12\x34\xab\xcd";
  ASSERT_TRUE(decode_image(reinterpret_cast<const std::uint8_t*>(wide.data()), wide.size(), image));
  EXPECT_EQ(image.pixels, (Bytes{0x12, 0xab}));
  const std::string twelve_bits = "P5 2 1 4095\n\x02\x34\x0b\xcd";
  ASSERT_TRUE(decode_image(reinterpret_cast<const std::uint8_t*>(twelve_bits.data()), twelve_bits.size(), image));
  EXPECT_EQ(image.pixels, (Bytes{0x23, 0xbc}));
}

/// Cameras of 10 and 12 bits leave the upper bits of 16 empty. A dark image among bright ones stays dark.
TEST(ImageFiles, OfSixteenBitsShowThoseThatAreUsed) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "epiline_used_bits";
  for (const int bits : {8, 10, 12, 14, 16}) {
    SCOPED_TRACE(bits);
    std::filesystem::create_directories(folder);
    std::vector<ImageFile> files;
    std::vector<cv::Mat> images;
    for (int n = 0; n < 7; ++n) {
      images.push_back(picture(CV_16U) / (n == 1 ? 64 : 1));
      images.back().forEach<std::uint16_t>([&](std::uint16_t& value, const int*) { value >>= 16 - bits; });
      files.push_back({HostStamp{}, folder / (std::to_string(n) + ".png"), n});
      cv::imwrite(files.back().path.string(), images.back());
    }
    const auto source = image_files(files, folder / "data.csv");
    for (std::size_t n : {std::size_t{1}, std::size_t{4}}) {
      GreyImage grey;
      ASSERT_TRUE(source->read(n, grey));
      cv::Mat expected(images[n].size(), CV_8U);
      for (int y = 0; y < expected.rows; ++y)
        for (int x = 0; x < expected.cols; ++x)
          expected.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(images[n].at<std::uint16_t>(y, x) >> (bits - 8));
      expect_same(grey, expected);
    }
    std::filesystem::remove_all(folder);
  }
}

TEST(ImageCodecs, AnImageIsDecodedOverAnother) {
  GreyImage image;
  const Bytes large = encoded(".png", picture(CV_8U, 200, 100)), small = encoded(".jpg", picture(CV_8U, 20, 10));
  ASSERT_TRUE(decode_image(large.data(), large.size(), image));
  ASSERT_TRUE(decode_image(small.data(), small.size(), image));
  expect_same(image, cv::imdecode(small, cv::IMREAD_GRAYSCALE));
}

TEST(ImageCodecs, WhatIsWrittenIsReadByOpenCv) {
  const cv::Mat wide = picture(CV_8U, 150, 60);
  const cv::Mat part = wide(cv::Rect(10, 5, 101, 43));  // rows with more behind them
  const std::string png = png_of(pixels_of(part));
  const cv::Mat back = cv::imdecode(Bytes(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(back.type(), CV_8U);
  EXPECT_EQ(cv::norm(back, part, cv::NORM_INF), 0);
  const std::string jpeg = jpeg_of(pixels_of(part), 80);
  Bytes theirs;
  cv::imencode(".jpg", part, theirs, {cv::IMWRITE_JPEG_QUALITY, 80});
  const cv::Mat ours_back = cv::imdecode(Bytes(jpeg.begin(), jpeg.end()), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(ours_back.type(), CV_8U);
  EXPECT_EQ(cv::norm(ours_back, cv::imdecode(theirs, cv::IMREAD_UNCHANGED), cv::NORM_INF), 0);
}

}  // namespace
}  // namespace epiline
