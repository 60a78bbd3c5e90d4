// Boards drawn by us and found in images by libapriltag and our sub-pixel step; OpenCV's cornerSubPix is the other
// opinion.
#include "drivers/study/calibrate/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "drivers/study/calibrate/board_drawing.h"
#include "drivers/study/calibrate/corner_refine.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/photographer.h"
#include "tests/drivers/study/calibrate/waved_rig.h"
#include "tests/support/apriltag.h"

namespace epiline {
namespace {

/// The board as that camera sees it: each pixel the mean of `kFine` squared rays.
GreyImage photograph(const std::vector<BlackBox>& boxes, const Camera& camera, const Mat3& R_TC, const Vec3& p_TC) {
  constexpr int kFine = 2;
  GreyImage image;
  image.resize(camera.width(), camera.height());
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int white = 0;
      for (int k = 0; k < kFine * kFine; ++k) {
        const Vec2 px(x - 0.5 + (k % kFine + 0.5) / kFine, y - 0.5 + (k / kFine + 0.5) / kFine);
        Vec3 f_C;
        if (!camera.unproject(px, f_C)) continue;
        const Vec3 f_T = R_TC * f_C;
        const Vec3 hit = p_TC - p_TC.z() / f_T.z() * f_T;
        const bool black = std::any_of(boxes.begin(), boxes.end(), [&](const BlackBox& box) {
          return hit.x() >= box.x && hit.y() >= box.y && hit.x() < box.x + box.width && hit.y() < box.y + box.height;
        });
        white += black ? 0 : 1;
      }
      image.row(y)[x] = static_cast<std::uint8_t>(30 + 200 * white / (kFine * kFine));
    }
  }
  return image;
}

GreyPixels pixels_of(GreyImage& image) { return {image.pixels.data(), image.width, image.height, image.width}; }

TEST(BoardDetector, FindsTheCornersOfATiltedBoardToATenthOfAPixel) {
  const AprilGrid grid{3, 2, 0.08, 0.3};
  auto detector = BoardDetector::create(grid);
  if (!detector && test::lacks_apriltag(detector.error().text())) GTEST_SKIP() << detector.error().text();
  ASSERT_TRUE(detector) << detector.error().text();
  const auto boxes = black_boxes(grid);
  ASSERT_TRUE(boxes);
  const Camera camera({CameraModel::kPinholeRadialTangential, 640, 480, {520, 520, 320, 240}, {-0.2, 0.03}});
  for (const Vec3& tilt : {Vec3(0, 0, 0.1), Vec3(0.5, 0.2, -0.4), Vec3(-0.3, 0.5, 1.7)}) {
    const Mat3 R_TC = Vec3(1, -1, -1).asDiagonal() * so3_exp(tilt);
    const Vec3 p_TC = Vec3(0.15, 0.09, 0) - 0.42 * R_TC.col(2);
    GreyImage image = photograph(*boxes, camera, R_TC, p_TC);
    const auto corners = detector->find(pixels_of(image));
    EXPECT_GE(corners.size(), 20u) << tilt.transpose();
    for (const Corner& corner : corners) {
      Vec2 px;
      ASSERT_TRUE(camera.project(R_TC.transpose() * (corner.p_T - p_TC), px));
      EXPECT_LT((px - corner.px).norm(), 0.15) << "corner " << corner.id << ", tilt " << tilt.transpose();
    }
  }
}

// Tags of 28 px, turned by any angle: the cells are 2.8 px wide.
TEST(BoardDetector, FindsSmallTagsAtEveryAngle) {
  const AprilGrid grid{4, 3, 0.024, 0.3};
  auto detector = BoardDetector::create(grid);
  if (!detector && test::lacks_apriltag(detector.error().text())) GTEST_SKIP() << detector.error().text();
  ASSERT_TRUE(detector) << detector.error().text();
  const auto boxes = black_boxes(grid);
  ASSERT_TRUE(boxes);
  const Camera camera({CameraModel::kPinholeRadialTangential, 320, 240, {458, 458, 160, 120}, {}});
  const Photographer photographer(grid, *boxes, camera);
  for (const double degrees : {0.0, 15.0, 30.0, 45.0, 60.0, 90.0}) {
    const Mat3 R_TC = Vec3(1, -1, -1).asDiagonal() * so3_exp(Vec3(0.02, 0.03, degrees * 3.14159265 / 180));
    const Vec3 p_TC = Vec3(0.5 * grid.width_m(), 0.5 * grid.height_m(), 0) - 0.39 * R_TC.col(2);
    GreyImage image = photographer.take(R_TC, p_TC);
    const auto corners = detector->find(pixels_of(image));
    EXPECT_EQ(corners.size(), 48u) << degrees << " degrees";
    for (const Corner& corner : corners) {
      Vec2 px;
      ASSERT_TRUE(camera.project(R_TC.transpose() * (corner.p_T - p_TC), px));
      EXPECT_LT((px - corner.px).norm(), 0.6) << "corner " << corner.id << ", " << degrees << " degrees";
    }
  }
}

TEST(BoardDetector, AnEmptyImageHasNoCorner) {
  auto detector = BoardDetector::create(AprilGrid{});
  if (!detector && test::lacks_apriltag(detector.error().text())) GTEST_SKIP() << detector.error().text();
  ASSERT_TRUE(detector) << detector.error().text();
  GreyImage image;
  image.resize(320, 240);
  std::fill(image.pixels.begin(), image.pixels.end(), std::uint8_t{128});
  EXPECT_TRUE(detector->find(pixels_of(image)).empty());
}

TEST(RefineCorner, AnEdgeIsNoCornerAndTheImagesRimIsLeftAlone) {
  GreyImage image;
  image.resize(64, 64);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) image.row(y)[x] = x < 32 ? 20 : 220;
  Vec2 px(32, 32);
  EXPECT_FALSE(refine_corner(pixels_of(image), 5, px));
  EXPECT_EQ(px, Vec2(32, 32));
  px = {3, 30};
  EXPECT_FALSE(refine_corner(pixels_of(image), 5, px));
}

TEST(AprilGrid, IsReadAsItIsWrittenAndComplaintsNameTheLine) {
  const auto file = std::filesystem::path(testing::TempDir()) / "board_of_april_grid_test.yaml";
  ASSERT_TRUE(write_text(file, board_yaml(AprilGrid{5, 7, 0.0251, 0.29})));
  const auto grid = read_april_grid(file);
  ASSERT_TRUE(grid) << grid.error().text();
  EXPECT_EQ(grid->columns, 5);
  EXPECT_EQ(grid->rows, 7);
  EXPECT_EQ(grid->tag_m, 0.0251);
  EXPECT_EQ(grid->spacing, 0.29);
  ASSERT_TRUE(write_text(file, "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 6\ntagSize: -1\ntagSpacing: 0.3\n"));
  EXPECT_THAT(read_april_grid(file).error().text(), testing::HasSubstr(":4: tagSize = -1"));
  ASSERT_TRUE(write_text(file, "target_type: 'checkerboard'\n"));
  EXPECT_THAT(read_april_grid(file).error().text(), testing::HasSubstr("not a board of AprilTags"));
  ASSERT_TRUE(write_text(file, "target_type: 'aprilgrid'\ntagCols: 60\ntagRows: 60\ntagSize: 1\ntagSpacing: 0.3\n"));
  EXPECT_FALSE(read_april_grid(file)) << "more tags than there are";
  std::filesystem::remove(file);
}

TEST(AprilGrid, APageIsAsLargeAsTheBoard) {
  const AprilGrid grid{6, 8, 0.024, 0.3};
  const auto pdf = board_pdf(grid);
  if (!pdf && test::lacks_apriltag(pdf.error().text())) GTEST_SKIP() << pdf.error().text();
  ASSERT_TRUE(pdf) << pdf.error().text();
  EXPECT_THAT(*pdf, testing::StartsWith("%PDF-1.4"));
  double width = 0, height = 0;
  const auto box = pdf->find("/MediaBox [0 0 ");
  ASSERT_EQ(std::sscanf(pdf->c_str() + box, "/MediaBox [0 0 %lf %lf", &width, &height), 2);
  EXPECT_NEAR(width * 0.0254 / 72, grid.width_m() + 4 * 0.3 * 0.024, 1e-6);
  EXPECT_LT(width, 595.3) << "fits on A4";
  EXPECT_LT(height, 841.9);
}

}  // namespace
}  // namespace epiline
