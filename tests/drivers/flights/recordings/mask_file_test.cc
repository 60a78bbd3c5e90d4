// Files of masks, and what is refused.
#include "drivers/flights/recordings/mask_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/flights/recordings/image_codecs.h"
#include "pipeline/vision/mask.h"

namespace epiline {
namespace {

using testing::HasSubstr;

CameraParameters camera() {
  CameraParameters p;
  p.width = 64;
  p.height = 48;
  return p;
}

class MaskFile : public testing::Test {
 protected:
  ~MaskFile() override { std::filesystem::remove_all(folder_); }
  /// A picture that is white up to a column.
  std::string picture(int width, int height, int white) const {
    GreyImage image;
    image.resize(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image.row(y)[x] = x < white ? 255 : 0;
    return write(png_of({image.pixels.data(), width, height, width}));
  }
  std::string write(const std::string& bytes) const {
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "mask.png", std::ios::binary) << bytes;
    return (folder_ / "mask.png").string();
  }
  std::string refusal(const std::string& file, std::size_t number = 0) {
    config.masks[number] = file;
    const Status s = read_mask(number, camera(), config);
    EXPECT_FALSE(s);
    EXPECT_EQ(config.tracker.masks[number], nullptr);
    return s ? "" : s.error().text();
  }

  Config config;

 private:
  std::filesystem::path folder_ = std::filesystem::path(testing::TempDir()) / ("mask_" + std::to_string(getpid()));
};

TEST_F(MaskFile, IsReadForItsCamera) {
  ASSERT_TRUE(read_mask(1, camera(), config)) << "none is configured";
  EXPECT_EQ(config.tracker.masks[1], nullptr);
  config.masks[1] = picture(64, 48, 32);
  ASSERT_TRUE(read_mask(1, camera(), config));
  ASSERT_NE(config.tracker.masks[1], nullptr);
  EXPECT_TRUE(config.tracker.masks[1]->sees(20, 20));
  EXPECT_FALSE(config.tracker.masks[1]->sees(40, 20));
  EXPECT_EQ(config.tracker.masks[0], nullptr);
}

TEST_F(MaskFile, OneThatDoesNotFitIsRefusedInTheUsersWords) {
  EXPECT_THAT(refusal(picture(640, 48, 640)),
              HasSubstr("mask.png: 640 x 48; expected 64 x 48, the size of the camera's images (camera.mask)"));
  EXPECT_THAT(refusal(write("no picture"), 1),
              HasSubstr("mask.png: cannot be read as an image; expected a complete PNG, JPEG or binary PGM "
                        "(second_camera.mask)"));
  EXPECT_THAT(refusal(picture(64, 48, 0)), HasSubstr("black everywhere"));
  EXPECT_THAT(refusal("/nowhere/mask.png"), HasSubstr("/nowhere/mask.png: cannot be opened"));
}

}  // namespace
}  // namespace epiline
