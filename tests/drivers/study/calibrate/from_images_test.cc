// From images of a board to a calibration, through the files that a user has.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/study/calibrate/board_drawing.h"
#include "drivers/study/calibrate/calibrate.h"
#include "pipeline/config/asl.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;

/// A printed board, in tenths of a millimetre, and a camera that takes its picture with 2 x 2 rays per pixel.
class Photographer {
 public:
  Photographer(const AprilGrid& grid, const std::vector<BlackBox>& boxes, const Camera& camera) : camera_(camera) {
    margin_ = 2 * grid.spacing * grid.tag_m;
    columns_ = static_cast<int>((grid.width_m() + 2 * margin_) / kDot_m);
    rows_ = static_cast<int>((grid.height_m() + 2 * margin_) / kDot_m);
    black_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0);
    for (const BlackBox& box : boxes)
      for (int y = dot(box.y); y < dot(box.y + box.height); ++y)
        for (int x = dot(box.x); x < dot(box.x + box.width); ++x) black_[index(x, y)] = 1;
    for (int y = 0; y < camera.height(); ++y) {
      for (int x = 0; x < camera.width(); ++x) {
        for (const double v : {-0.25, 0.25}) {
          for (const double u : {-0.25, 0.25}) {
            Vec3 f_C = Vec3::Zero();
            camera.unproject(Vec2(x + u, y + v), f_C);
            rays_.push_back(f_C);
          }
        }
      }
    }
  }

  /// As a binary PGM.
  std::string take(const Mat3& R_TC, const Vec3& p_TC) const {
    std::string image = "P5\n" + std::to_string(camera_.width()) + " " + std::to_string(camera_.height()) + "\n255\n";
    for (std::size_t i = 0; i < rays_.size(); i += 4) {
      int white = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const Vec3 f_T = R_TC * rays_[i + k];
        const Vec3 hit = p_TC - p_TC.z() / f_T.z() * f_T;
        const int x = dot(hit.x()), y = dot(hit.y());
        white += x >= 0 && y >= 0 && x < columns_ && y < rows_ && black_[index(x, y)] != 0 ? 0 : 1;
      }
      image += static_cast<char>(40 + 45 * white);
    }
    return image;
  }

 private:
  static constexpr double kDot_m = 1e-4;
  int dot(double m) const { return static_cast<int>(std::lround((m + margin_) / kDot_m)); }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x);
  }
  Camera camera_;
  double margin_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> black_;
  std::vector<Vec3> rays_;
};

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
                           photographer.take(at.R_TB * rig.R_BC, at.p_TB + at.R_TB * rig.p_BC)));
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
