// From images of a board to a calibration, through the files that a user has.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/study/calibrate/calibrate.h"
#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/photographer.h"
#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

std::string pgm(const GreyImage& image) {
  return "P5\n" + std::to_string(image.width) + " " + std::to_string(image.height) + "\n255\n" +
         std::string(image.pixels.begin(), image.pixels.end());
}

TEST(Calibrate, FromImagesOfABoard) {
  const AprilGrid grid{4, 4, 0.088, 0.3};  // where WavedRig looks
  const auto boxes = black_boxes(grid);
  if (!boxes) GTEST_SKIP() << boxes.error().text();
  WavedRig rig;
  rig.lens = {CameraModel::kPinholeRadialTangential, 480, 360, {330, 330, 243, 178}, {-0.2, 0.05}};
  rig.seconds = 9;
  const fs::path folder = fs::path(testing::TempDir()) / "calibrate_from_images";
  fs::remove_all(folder);
  fs::create_directories(folder / "mav0" / "cam0" / "data");
  fs::create_directories(folder / "mav0" / "imu0");
  std::string imu = kAslImuHeader, list = kAslImagesHeader;
  for (const ImuSample& sample : rig.readings()) append_asl_imu(imu, sample);
  const Photographer photographer(grid, *boxes, Camera(rig.lens));
  for (double t = 0.3; t < rig.seconds - 0.3; t += 0.1) {
    const HostStamp stamp = WavedRig::kBegin + Span::from_seconds(t - rig.time_offset_s);
    const std::string name = std::to_string(stamp.ns) + ".pgm";
    const WavedRig::Pose at = rig.pose(t);
    append_asl_image(list, stamp, name);
    ASSERT_TRUE(write_text(folder / "mav0" / "cam0" / "data" / name,
                           pgm(photographer.take(at.R_TB * rig.R_BC, at.p_TB + at.R_TB * rig.p_BC))));
  }
  ASSERT_TRUE(write_text(folder / "mav0" / "imu0" / "data.csv", imu));
  ASSERT_TRUE(write_text(folder / "mav0" / "cam0" / "data.csv", list));
  ASSERT_TRUE(write_text(folder / "board.yaml", april_grid_yaml(grid)));

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
  fs::remove_all(folder);
}

}  // namespace
}  // namespace epiline
