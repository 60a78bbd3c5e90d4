// Boards drawn by us and found in images by libapriltag and our sub-pixel step; their descriptions and prints.
#include "drivers/study/calibrate/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

#include "drivers/study/calibrate/board_drawing.h"
#include "estimator/geometry/so3.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/photographer.h"
#include "tests/support/apriltag.h"

namespace epiline {
namespace {

GreyPixels pixels_of(const GreyImage& image) { return {image.pixels.data(), image.width, image.height, image.width}; }

class TiltedBoards : public testing::Test {
 protected:
  void SetUp() override {
    const auto detector = BoardDetector::create(AprilGrid{});
    if (!detector && test::lacks_apriltag(detector.error().text())) GTEST_SKIP() << detector.error().text();
    ASSERT_TRUE(detector) << detector.error().text();
  }

  /// Before that place of the board, at each tilt: so many corners at least, each so close to where it projects.
  static void expect_corners(const AprilGrid& grid, const CameraParameters& lens, const Vec3& place_T,
                             double distance_m, const std::vector<Vec3>& tilts, std::size_t least, double most_px) {
    const auto boxes = black_boxes(grid);
    auto detector = BoardDetector::create(grid);
    ASSERT_TRUE(boxes && detector);
    const Camera camera(lens);
    const Photographer photographer(grid, *boxes, camera);
    for (const Vec3& tilt : tilts) {
      const Mat3 R_TC = Vec3(1, -1, -1).asDiagonal() * so3_exp(tilt);
      const Vec3 p_TC = place_T - distance_m * R_TC.col(2);
      const GreyImage image = photographer.take(R_TC, p_TC);
      const auto corners = detector->find(pixels_of(image));
      EXPECT_GE(corners.size(), least) << tilt.transpose();
      for (const BoardCorner& corner : corners) {
        Vec2 px;
        ASSERT_TRUE(camera.project(R_TC.transpose() * (corner.p_T - p_TC), px));
        EXPECT_LT((px - corner.px).norm(), most_px) << "corner " << corner.id << ", tilt " << tilt.transpose();
      }
    }
  }
};

TEST_F(TiltedBoards, HaveTheirCornersToATenthOfAPixel) {
  expect_corners({3, 2, 0.08, 0.3},
                 {CameraModel::kPinholeRadialTangential, 640, 480, {520, 520, 320, 240}, {-0.2, 0.03}}, {0.15, 0.09, 0},
                 0.42, {{0, 0, 0.1}, {0.5, 0.2, -0.4}, {-0.3, 0.5, 1.7}}, 20, 0.15);
}

// Tags of 28 px, turned by any angle: the cells are 2.8 px wide.
TEST_F(TiltedBoards, AreFoundAtEveryAngleAlsoIfTagsAreSmall) {
  std::vector<Vec3> tilts;
  for (const double degrees : {0, 15, 30, 45, 60, 90}) tilts.emplace_back(0.02, 0.03, degrees * std::numbers::pi / 180);
  const AprilGrid grid{4, 3, 0.024, 0.3};
  expect_corners(grid, {CameraModel::kPinholeRadialTangential, 320, 240, {458, 458, 160, 120}, {}},
                 {grid.width_m() / 2, grid.height_m() / 2, 0}, 0.39, tilts, 48, 0.6);
}

TEST_F(TiltedBoards, AreNotSeenInAnEmptyImage) {
  auto detector = BoardDetector::create(AprilGrid{});
  ASSERT_TRUE(detector);
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

TEST(BoardFile, IsReadAsItIsWritten) {
  const auto file = std::filesystem::path(testing::TempDir()) / "board_file_test.yaml";
  ASSERT_TRUE(write_text(file, board_yaml(AprilGrid{5, 7, 0.0251, 0.29})));
  const auto april = read_board(file);
  ASSERT_TRUE(april) << april.error().text();
  const auto grid = std::get<AprilGrid>(*april);
  EXPECT_EQ(std::tuple(grid.columns, grid.rows, grid.tag_m, grid.spacing), std::tuple(5, 7, 0.0251, 0.29));
  ASSERT_TRUE(write_text(file, board_yaml(CharucoBoard{5, 8, 0.0301, 0.0225})));
  const auto chess = read_board(file);
  ASSERT_TRUE(chess) << chess.error().text();
  const auto board = std::get<CharucoBoard>(*chess);
  EXPECT_EQ(std::tuple(board.columns, board.rows, board.square_m, board.tag_m), std::tuple(5, 8, 0.0301, 0.0225));
  std::filesystem::remove(file);
}

TEST(BoardFile, ComplaintsSayWhatIsWrongAndWhere) {
  const auto file = std::filesystem::path(testing::TempDir()) / "wrong_board_file_test.yaml";
  const std::string grid = "target_type: 'aprilgrid'\n", tags = "tagSpacing: 0.3\ntagRows: 60\n",
                    charuco = "target_type: 'charuco'\ndictionary: 'apriltag_36h11'\n";
  for (const auto& [text, complaint] : {
           std::pair(grid + tags + "tagCols: 6\ntagSize: -1\n", ":5: tagSize = -1"),
           std::pair(grid + tags + "tagCols: 60\ntagSize: 1\n", "3600 tags"),
           std::pair(std::string("target_type: 'checkerboard'\n"), "not a board of AprilTags"),
           std::pair(std::string("target_type: 'charuco'\ndictionary: '4x4_50'\n"), ":2: the dictionary \"4x4_50\""),
           std::pair(charuco + "squaresX: 2\nsquaresY: 7\n", "2 x 7 squares"),
           std::pair(charuco + "squaresX: 50\nsquaresY: 50\n", "1250 tags"),
           std::pair(charuco + "squaresX: 5\nsquaresY: 7\nmarkerSize: 0.03\n", "no number `squareSize`"),
           std::pair(charuco + "squaresX: 5\nsquaresY: 7\nsquareSize: 0.03\nmarkerSize: 0.03\n",
                     ":6: markerSize = 0.03"),
       }) {
    ASSERT_TRUE(write_text(file, text));
    const auto read = read_board(file);
    ASSERT_FALSE(read) << complaint;
    EXPECT_THAT(read.error().text(), testing::HasSubstr(complaint));
  }
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
