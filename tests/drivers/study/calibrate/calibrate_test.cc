// The parts of a calibration before the fit, what they refuse, and the files that a calibration leaves behind.
#include "drivers/study/calibrate/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "drivers/study/calibrate/calibration_files.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "estimator/geometry/so3.h"
#include "pipeline/text/table.h"
#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

fs::path scratch(const std::string& name) {
  const fs::path folder = fs::path(testing::TempDir()) / ("calibrate_" + name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  return folder;
}

std::string complaint_about(const std::string& target) {
  const fs::path file = scratch("target") / "target.csv";
  EXPECT_TRUE(write_text(file, target));
  const auto read = read_target(file);
  return read ? "" : read.error().text();
}

TEST(Target, SaysWhatIsWrongWithIt) {
  EXPECT_THAT(complaint_about("0,0,0,0\n1,1,0,0\n1,1,1,0\n3,0,1,0\n"), HasSubstr("corner 1 twice"));
  EXPECT_THAT(complaint_about("0,0,0,0\n1,1,0,0\n2,1,1,0.1\n3,0,1,0\n"), HasSubstr("corner 2 outside the plane"));
  EXPECT_THAT(complaint_about("0,0,0,0\n1,1,0,0\n2,1,1,0\n"), HasSubstr("3 corners"));
  EXPECT_THAT(complaint_about("0,0,0,0\n1,x,0,0\n"), HasSubstr(":2: "));
  EXPECT_THAT(complaint_about("-1,0,0,0\n1,1,0,0\n2,1,1,0\n3,0,1,0\n"), HasSubstr("the id -1"));
  EXPECT_EQ(complaint_about("0,0,0,0\n1,1,0,0\n2,1,1,0\n3,0,1,0\n"), "");
}

class Lenses : public testing::TestWithParam<CameraModel> {};

// From nothing: rig_fit_test.cc.
TEST_P(Lenses, AreFoundFromAWrongGuess) {
  WavedRig rig;
  rig.lens = lens_of(GetParam());
  rig.seconds = 8;
  rig.distance_m = GetParam() == CameraModel::kPinholeRadialTangential ? 0.55 : 0.33;
  const auto views = rig.views();
  CameraParameters wrong = rig.lens;
  wrong.intrinsics[0] *= 1.2;
  wrong.intrinsics[1] *= 1.2;
  wrong.distortion = {};
  if (GetParam() == CameraModel::kDoubleSphere) wrong.distortion = {0, 0.5};
  const auto fit = fit_lens(views, GetParam(), rig.lens.width, rig.lens.height, wrong);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_NEAR(fit->sigma_px, rig.corner_px, 0.2 * rig.corner_px);
  // where pixels go, not the numbers, which trade places
  const Camera found(fit->lens), truth(rig.lens);
  for (double x = -0.5; x <= 0.5; x += 0.25) {
    for (double y = -0.4; y <= 0.4; y += 0.2) {
      Vec2 a, b;
      ASSERT_TRUE(found.project({x, y, 1}, a) && truth.project({x, y, 1}, b));
      EXPECT_LT((a - b).norm(), 3) << x << " " << y;
    }
  }
}
INSTANTIATE_TEST_SUITE_P(All, Lenses,
                         testing::Values(CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant,
                                         CameraModel::kDoubleSphere));

TEST(Lens, TheModelIsFoundToo) {
  WavedRig rig;
  rig.lens = lens_of(CameraModel::kDoubleSphere);
  rig.distance_m = 0.25;
  rig.seconds = 6;
  const auto fit = choose_lens(rig.views(), rig.lens.width, rig.lens.height);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_NE(fit->lens.model, CameraModel::kPinholeRadialTangential) << "a fisheye";
}

/// 281 px, 0.40, 0.749 draws almost the same picture, and few images do not tell which is right.
TEST(Lens, OfADoubleSphereIsNotItsTwin) {
  WavedRig rig;
  rig.lens = lens_of(CameraModel::kDoubleSphere);
  rig.distance_m = 0.3;
  rig.bend_m = 1e-3;
  rig.seed = 4;
  const auto fit = fit_lens(rig.views(), rig.lens.model, rig.lens.width, rig.lens.height, std::nullopt);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_NEAR(fit->lens.intrinsics[0], rig.lens.intrinsics[0], 2);
  EXPECT_NEAR(fit->lens.distortion[0], rig.lens.distortion[0], 0.01);
}

TEST(Lens, CornersOfAnotherBoardAreRefused) {
  WavedRig rig;
  rig.seconds = 4;
  auto views = rig.views();
  Random random(1, 2);
  for (CornerView& view : views)
    for (BoardCorner& corner : view.corners) corner.px = Vec2(376, 240) + 100 * random.normal3(1).head<2>();
  const auto fit = fit_lens(views, rig.lens.model, rig.lens.width, rig.lens.height, std::nullopt);
  ASSERT_FALSE(fit);
  EXPECT_THAT(fit.error().text(), HasSubstr("no radial-tangential lens explains the corners"));
}

TEST(Lens, TooFewImagesAreRefused) {
  WavedRig rig;
  auto views = rig.views();
  views.resize(5);
  const auto fit = fit_lens(views, rig.lens.model, rig.lens.width, rig.lens.height, std::nullopt);
  ASSERT_FALSE(fit);
  EXPECT_THAT(fit.error().text(), HasSubstr("5 images that show"));
}

std::vector<CameraOrientation> turns_of(const WavedRig& rig) {
  std::vector<CameraOrientation> turns;
  for (double t = 0.3; t < rig.seconds - 0.3; t += 0.05)
    turns.push_back({WavedRig::kBegin + Span::from_seconds(t - rig.time_offset_s), rig.pose(t).R_TB * rig.R_BC});
  return turns;
}

TEST(Turns, FindAnyMountAndAnyOffset) {
  for (const Vec3& mount : {Vec3(0, 0, 0), Vec3(3.1, 0, 0), Vec3(0.5, -1.8, 1.1)}) {
    for (const double offset : {-0.31, 0.0, 0.02, 0.44}) {
      WavedRig rig;
      rig.seconds = 12;
      rig.R_BC = so3_exp(mount);
      rig.time_offset_s = offset;
      const auto found = align_turns(turns_of(rig), rig.readings());
      ASSERT_TRUE(found) << found.error().text();
      EXPECT_LT(so3_log(found->R_BC.transpose() * rig.R_BC).norm(), 0.01) << mount.transpose() << ", " << offset;
      EXPECT_NEAR(found->time_offset_s, offset, 0.002);
    }
  }
}

TEST(Turns, OneAxisIsNotEnough) {
  WavedRig rig;
  rig.turns = 0;
  const auto found = align_turns(turns_of(rig), rig.readings());
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text(), HasSubstr("turns about one axis only"));
}

TEST(Turns, AGyroscopeInDegreesOrOfAnotherFlightIsRefused) {
  WavedRig rig, other;
  rig.seconds = 12;
  other.seconds = 12;
  other.seed = 9;
  EXPECT_FALSE(align_turns(turns_of(rig), other.readings()));
  std::vector<ImuSample> degrees = rig.readings();
  for (ImuSample& sample : degrees)
    for (double& rate : sample.angular_velocity_rad_s) rate *= 57.3;
  const auto found = align_turns(turns_of(rig), degrees);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text(), HasSubstr("do not fit the gyroscope's"));
}

TEST(CalibrationFiles, AreReadBackAsTheyWere) {
  for (const CameraModel model :
       {CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant, CameraModel::kDoubleSphere}) {
    const WavedRig rig;
    const CameraCalibration written{lens_of(model), rig.R_BC, rig.p_BC, -0.0123};
    const fs::path folder = scratch("files");
    ASSERT_TRUE(write_text(folder / "camera.yaml", kalibr_camera(written, "cam0")));
    const auto read = read_camera_calibration(folder / "camera.yaml", "cam0");
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->parameters.model, model);
    EXPECT_EQ(read->parameters.intrinsics, written.parameters.intrinsics);
    EXPECT_EQ(read->parameters.distortion, written.parameters.distortion);
    EXPECT_LT((read->R_BC - written.R_BC).norm(), 1e-12);
    EXPECT_LT((read->p_BC - written.p_BC).norm(), 1e-12);
    EXPECT_EQ(read->time_offset_s, written.time_offset_s);
    ImuCalibration imu;
    imu.noise.gyroscope_density = 1.25e-4;
    imu.saturation_accelerometer_m_s2 = 78;
    ASSERT_TRUE(write_text(folder / "imu.yaml", kalibr_imu(imu, 200)));
    const auto imu_read = read_imu_calibration(folder / "imu.yaml");
    ASSERT_TRUE(imu_read) << imu_read.error().text();
    EXPECT_EQ(imu_read->noise.gyroscope_density, 1.25e-4);
    EXPECT_EQ(imu_read->saturation_accelerometer_m_s2, 78);
  }
}

}  // namespace
}  // namespace epiline
