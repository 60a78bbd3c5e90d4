// From images of a board to a calibration, through the files that a user has.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "drivers/study/calibrate/calibrate.h"
#include "tests/drivers/study/calibrate/board_recording.h"
#include "tests/support/apriltag.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

class FromImages : public testing::TestWithParam<Board> {};
INSTANTIATE_TEST_SUITE_P(Boards, FromImages, testing::Values(waved_grid(), waved_charuco()));

TEST_P(FromImages, ARigIsCalibratedAndAMirrorIsSeen) {
  WavedRig rig;
  rig.lens = {CameraModel::kPinholeRadialTangential, 480, 360, {330, 330, 243, 178}, {-0.2, 0.05}};
  rig.seconds = 9;
  rig.image_rate_hz = 10;
  const fs::path folder = fs::path(testing::TempDir()) / "calibrate_from_images";
  fs::remove_all(folder);
  const Status written = write_board_recording(rig, folder, GetParam());
  if (!written && test::lacks_apriltag(written.error().text())) GTEST_SKIP() << written.error().text();
  ASSERT_TRUE(written) << written.error().text();

  CalibrateSettings settings;
  settings.dataset = folder;
  EXPECT_FALSE(calibrate(settings)) << "no board was named";
  settings.board = folder / "board.yaml";
  const auto found = calibrate(settings);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_EQ(found->camera.parameters.width, 480);
  EXPECT_NEAR(found->camera.parameters.intrinsics[0], 330, 1.5);
  EXPECT_LT(so3_log(found->camera.R_BC.transpose() * rig.R_BC).norm(), 5e-3);
  EXPECT_LT((found->camera.p_BC - rig.p_BC).norm(), 5e-3);
  EXPECT_NEAR(found->camera.time_offset_s, rig.time_offset_s, 5e-4);
  EXPECT_LT(found->fit.rms_px, 0.3);

  const int width = rig.lens.width, height = rig.lens.height;
  for (const auto& file : fs::directory_iterator(folder / "mav0" / "cam0" / "data")) {
    std::fstream image(file.path(), std::ios::in | std::ios::out | std::ios::binary);
    std::string pixels(static_cast<std::size_t>(width * height), ' ');
    const auto header = static_cast<std::streamoff>(fs::file_size(file.path()) - pixels.size());
    image.seekg(header).read(pixels.data(), static_cast<std::streamsize>(pixels.size()));
    for (auto row = pixels.begin(); row != pixels.end(); row += width) std::reverse(row, row + width);
    image.seekp(header).write(pixels.data(), static_cast<std::streamsize>(pixels.size()));
  }
  const auto mirrored = calibrate(settings);
  ASSERT_FALSE(mirrored);
  EXPECT_NE(mirrored.error().text().find("the images are mirrored"), std::string::npos) << mirrored.error().text();
  fs::remove_all(folder);
}

}  // namespace
}  // namespace epiline
