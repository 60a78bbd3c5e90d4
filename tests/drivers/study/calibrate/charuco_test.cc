// ChArUco boards: OpenCV draws what we find, and finds what we draw.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "drivers/study/calibrate/board_detector.h"
#include "drivers/study/calibrate/board_drawing.h"
#include "drivers/study/calibrate/calibrate.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/board_recording.h"
#include "tests/drivers/study/calibrate/opencv_charuco.h"
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
  for (const Corner& corner : corners) {
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

TEST(CharucoFile, IsReadAsItIsWrittenAndOtherDictionariesAreRefused) {
  const auto file = std::filesystem::path(testing::TempDir()) / "charuco_test_board.yaml";
  ASSERT_TRUE(write_text(file, board_yaml(CharucoBoard{5, 8, 0.0301, 0.0225})));
  const auto board = read_board(file);
  ASSERT_TRUE(board) << board.error().text();
  const auto* charuco = std::get_if<CharucoBoard>(&*board);
  ASSERT_NE(charuco, nullptr);
  EXPECT_EQ(charuco->columns, 5);
  EXPECT_EQ(charuco->rows, 8);
  EXPECT_EQ(charuco->square_m, 0.0301);
  EXPECT_EQ(charuco->tag_m, 0.0225);
  const auto complaint = [&](const std::string& text) {
    EXPECT_TRUE(write_text(file, text));
    const auto read = read_board(file);
    return read ? std::string("read") : read.error().text();
  };
  const std::string head = "target_type: 'charuco'\n", dictionary = "dictionary: 'apriltag_36h11'\n";
  EXPECT_THAT(complaint(head + "dictionary: '4x4_50'\nsquaresX: 5\nsquaresY: 7\nsquareSize: 0.03\nmarkerSize: 0.02\n"),
              testing::HasSubstr(":2: the dictionary \"4x4_50\""));
  EXPECT_THAT(complaint(head + dictionary + "squaresX: 2\nsquaresY: 7\nsquareSize: 0.03\nmarkerSize: 0.02\n"),
              testing::HasSubstr("2 x 7 squares"));
  EXPECT_THAT(complaint(head + dictionary + "squaresX: 5\nsquaresY: 7\nsquareSize: 0.03\nmarkerSize: 0.03\n"),
              testing::HasSubstr(":6: markerSize = 0.03"));
  EXPECT_THAT(complaint(head + dictionary + "squaresX: 5\nsquaresY: 7\nmarkerSize: 0.03\n"),
              testing::HasSubstr("no number `squareSize`"));
  EXPECT_THAT(complaint(head + dictionary + "squaresX: 50\nsquaresY: 50\nsquareSize: 0.03\nmarkerSize: 0.02\n"),
              testing::HasSubstr("1250 tags"));
  std::filesystem::remove(file);
}

TEST(CharucoRecording, CalibratesARig) {
  WavedRig rig;
  rig.lens = {CameraModel::kPinholeRadialTangential, 480, 360, {330, 330, 243, 178}, {-0.2, 0.05}};
  rig.seconds = 9;
  rig.image_rate_hz = 10;
  const auto folder = std::filesystem::path(testing::TempDir()) / "charuco_test_recording";
  std::filesystem::remove_all(folder);
  const Status written = write_board_recording(rig, folder, waved_charuco());
  if (!written && test::lacks_apriltag(written.error().text())) GTEST_SKIP() << written.error().text();
  ASSERT_TRUE(written) << written.error().text();
  CalibrateSettings settings;
  settings.dataset = folder;
  settings.board = folder / "board.yaml";
  const auto found = calibrate(settings);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_NEAR(found->camera.parameters.intrinsics[0], 330, 1.5);
  EXPECT_LT(so3_log(found->camera.R_BC.transpose() * rig.R_BC).norm(), 5e-3);
  EXPECT_LT((found->camera.p_BC - rig.p_BC).norm(), 5e-3);
  EXPECT_NEAR(found->camera.time_offset_s, rig.time_offset_s, 5e-4);
  EXPECT_LT(found->fit.rms_px, 0.3);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace epiline
