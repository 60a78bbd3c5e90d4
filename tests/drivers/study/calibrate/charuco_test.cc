// ChArUco boards: OpenCV draws what we find, and finds what we draw.
#include <gtest/gtest.h>

#include "drivers/study/calibrate/board_detector.h"
#include "drivers/study/calibrate/board_drawing.h"
#include "estimator/geometry/so3.h"
#include "tests/drivers/study/calibrate/opencv_charuco.h"
#include "tests/drivers/study/calibrate/photographer.h"
#include "tests/support/apriltag.h"

namespace epiline {
namespace {

class Charuco : public testing::TestWithParam<CharucoBoard> {
 protected:
  void SetUp() override {
    const auto detector = BoardDetector::create(GetParam());
    if (!detector && test::lacks_apriltag(detector.error().text())) GTEST_SKIP() << detector.error().text();
    ASSERT_TRUE(detector) << detector.error().text();
  }
};

/// Even numbers of rows and columns are drawn otherwise than odd ones.
INSTANTIATE_TEST_SUITE_P(Boards, Charuco,
                         testing::Values(CharucoBoard{5, 7, 0.04, 0.03}, CharucoBoard{6, 4, 0.05, 0.035},
                                         CharucoBoard{5, 4, 0.04, 0.03}, CharucoBoard{4, 5, 0.04, 0.025}));

TEST_P(Charuco, EveryCornerOfABoardDrawnByOpenCvIsFoundWhereItIs) {
  const CharucoBoard board = GetParam();
  constexpr int kSquare_px = 60, kRim_px = 20;
  const cv::Mat drawn = test::OpencvCharuco(board).draw(
      {board.columns * kSquare_px + 2 * kRim_px, board.rows * kSquare_px + 2 * kRim_px}, kRim_px);
  auto detector = BoardDetector::create(board);
  const auto corners = detector->find({drawn.data, drawn.cols, drawn.rows, static_cast<int>(drawn.step)});
  EXPECT_EQ(corners.size(), static_cast<std::size_t>((board.columns - 1) * (board.rows - 1)));
  for (const BoardCorner& corner : corners) {
    // pixel centres are whole numbers, so the edge before the first pixel is at -0.5
    const Vec2 expected(kRim_px - 0.5 + kSquare_px * corner.p_T.x() / board.square_m,
                        kRim_px - 0.5 + kSquare_px * (board.height_m() - corner.p_T.y()) / board.square_m);
    EXPECT_LT((corner.px - expected).norm(), 0.1) << "corner " << corner.id;
  }
}

TEST_P(Charuco, OpenCvFindsEveryCornerOfOurDrawing) {
  const CharucoBoard board = GetParam();
  const auto boxes = black_boxes(board);
  ASSERT_TRUE(boxes) << boxes.error().text();
  const Camera camera({CameraModel::kPinholeRadialTangential, 640, 640, {900, 900, 319.5, 319.5}, {}});
  const Photographer photographer(board, *boxes, camera);
  const Mat3 R_TC = Vec3(1, -1, -1).asDiagonal() * so3_exp(Vec3(0.2, -0.1, 0.3));
  const Vec3 p_TC = Vec3(board.width_m() / 2, board.height_m() / 2, 0) - 0.55 * R_TC.col(2);
  GreyImage image = photographer.take(R_TC, p_TC);
  const cv::Mat picture(image.height, image.width, CV_8U, image.pixels.data());
  const test::OpencvCharuco judge(board);
  const auto [tags, ids, corners] = judge.find(picture);
  EXPECT_EQ(tags, static_cast<std::size_t>(board.tags()));
  EXPECT_EQ(ids.size(), static_cast<std::size_t>((board.columns - 1) * (board.rows - 1)));
  const std::vector<cv::Point3f> places = judge.places();
  const Target target = board.target();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    // OpenCV numbers and places corners with y down
    const cv::Point3f there = places[static_cast<std::size_t>(ids[i])];
    const Vec3 p_T(there.x, board.height_m() - there.y, 0);
    EXPECT_LT((target.at(static_cast<std::uint32_t>(ids[i])) - p_T).norm(), 1e-6) << "corner " << ids[i];
    Vec2 px;
    ASSERT_TRUE(camera.project(R_TC.transpose() * (p_T - p_TC), px));
    // OpenCV 4.6 puts its corners half a pixel to the right and down
    EXPECT_LT((px + Vec2(0.5, 0.5) - Vec2(corners[i].x, corners[i].y)).norm(), 0.5) << "corner " << ids[i];
  }
}

}  // namespace
}  // namespace epiline
