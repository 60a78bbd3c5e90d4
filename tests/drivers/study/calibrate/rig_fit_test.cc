// Derivation: docs/derivations/rig.md.
#include "drivers/study/calibrate/rig_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drivers/study/calibrate/calibrate.h"
#include "drivers/study/calibrate/lens_columns.h"
#include "estimator/geometry/so3.h"
#include "tests/drivers/study/calibrate/waved_rig.h"

namespace epiline {
namespace {

using testing::HasSubstr;
using testing::Not;

/// From the first guess on, as calibrate() does it.
Result<RigFit> fit_of(const WavedRig& rig, const std::vector<CornerView>& views, CameraModel model) {
  const auto imu = rig.readings();
  const auto lens = fit_lens(views, model, rig.lens.width, rig.lens.height, std::nullopt);
  if (!lens) return lens.error();
  const auto turns = align_turns(turns_of(views, *lens), imu);
  if (!turns) return turns.error();
  return fit_rig(views, *lens, *turns, imu, {rig.imu.noise});
}

Verdict verdict_on(const RigFit& fit, const std::string& what) {
  Calibration c;
  c.camera.parameters = fit.state.constants.lens;
  c.fit = fit;
  judge(c);
  const auto found = std::find_if(c.verdicts.begin(), c.verdicts.end(), [&](auto& v) { return v.what == what; });
  return found == c.verdicts.end() ? Verdict{} : *found;
}

class Rigs : public testing::TestWithParam<CameraModel> {
 protected:
  Rigs() {
    rig_.lens = lens_of(GetParam());
    if (GetParam() == CameraModel::kDoubleSphere) rig_.distance_m = 0.3;
    if (GetParam() == CameraModel::kPinholeEquidistant) rig_.distance_m = 0.35;
    rig_.bend_m = 1e-3;
    rig_.imu.gyroscope_matrix = Vec3(1.004, 0.997, 1.002).asDiagonal();
    rig_.imu.accelerometer_matrix = Vec3(0.996, 1.003, 1.005).asDiagonal();
    // as far apart as in a VI-Sensor's IMU
    rig_.accelerometers_B << -5e-3, 2e-3, 3e-3, 7e-3, -5e-3, -2e-3, -2e-3, -1e-3, 3e-3;
  }
  WavedRig rig_;
};

TEST_P(Rigs, EveryFigureIsWithinWhatIsClaimed) {
  const auto fit = fit_of(rig_, rig_.views(), GetParam());
  ASSERT_TRUE(fit) << fit.error().text();
  const RigConstants& c = fit->state.constants;
  const RigColumns columns(0, GetParam());
  const auto expect = [&](int column, double error, const char* what) {
    EXPECT_LT(std::abs(error), 4 * fit->sigma(column)) << what << ": sigma " << fit->sigma(column);
  };
  const LensStep off = lens_values(c.lens) - lens_values(rig_.lens);
  for (int i = 0; i < off.size(); ++i) expect(i, off[i], lens_column_name(GetParam(), i));
  const Vec3 turn = so3_log(rig_.R_BC.transpose() * c.R_BC), place = c.p_BC - rig_.p_BC;
  for (int i = 0; i < 3; ++i) {
    expect(columns.R_BC + i, turn[i], "rotation");
    expect(columns.p_BC + i, place[i], "place");
    expect(columns.gyroscope_gain + i, c.gyroscope_gain[i] - 1 / rig_.imu.gyroscope_matrix(i, i), "gyroscope");
    expect(columns.accelerometer_gain + i, c.accelerometer_gain[i] - 1 / rig_.imu.accelerometer_matrix(i, i),
           "accelerometer");
    expect(columns.accelerometer_y + i, c.accelerometers_B(i, 1) - rig_.accelerometers_B(i, 1), "y's accelerometer");
    expect(columns.accelerometer_z + i, c.accelerometers_B(i, 2) - rig_.accelerometers_B(i, 2), "z's accelerometer");
  }
  EXPECT_TRUE(fit->is_board_as_described());
  EXPECT_LT(std::abs(fit->board_size), 4 * fit->board_size_sigma);
  EXPECT_LT(fit->board_size_sigma, 0.02);
  EXPECT_LT((c.accelerometers_B * Vec3::Ones()).norm(), 1e-12) << "their middle is the origin";
  expect(columns.time_offset, c.time_offset_s - rig_.time_offset_s, "time offset");
  EXPECT_LT((c.g_T.normalized() - rig_.g_T().normalized()).norm(), 2e-3);
  // and it is worth something
  EXPECT_LT(fit->sigma(0), 0.005 * rig_.lens.intrinsics[0]);
  EXPECT_LT(fit->sigma(columns.R_BC), 2e-3);
  EXPECT_LT(fit->sigma(columns.p_BC), 5e-3);
  EXPECT_LT(fit->sigma(columns.time_offset), 1e-3);
  EXPECT_LT(fit->sigma(columns.accelerometer_y), 1.5e-3);
  EXPECT_EQ(fit->uncertainty.misfit.cols(), 0) << "the lens has the model's shape";
  EXPECT_NEAR(fit->noise.corner_px, rig_.corner_px, 0.15 * rig_.corner_px);
  EXPECT_NEAR(fit->noise.gyroscope_density / rig_.imu.noise.gyroscope_density, 1, 0.15);
  EXPECT_NEAR(fit->noise.accelerometer_density / rig_.imu.noise.accelerometer_density, 1, 0.15);
}

INSTANTIATE_TEST_SUITE_P(All, Rigs,
                         testing::Values(CameraModel::kPinholeRadialTangential, CameraModel::kPinholeEquidistant,
                                         CameraModel::kDoubleSphere));

/// A board whose file says another size than it has.
class WrongSize : public testing::TestWithParam<double> {};

TEST_P(WrongSize, IsToldByTheAccelerometer) {
  WavedRig rig;
  auto views = rig.views();
  for (CornerView& view : views)
    for (BoardCorner& corner : view.corners) corner.p_T *= GetParam();
  const auto fit = fit_of(rig, views, rig.lens.model);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_FALSE(fit->is_board_as_described());
  EXPECT_NEAR(fit->board_size, -std::log(GetParam()), 4 * fit->board_size_sigma);
  EXPECT_LT(fit->board_size_sigma, 0.02);
  const RigColumns columns(0, rig.lens.model);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(fit->state.constants.p_BC[i], rig.p_BC[i], 4 * fit->sigma(columns.p_BC + i)) << "metres are true";
  const Verdict board = verdict_on(*fit, "board");
  EXPECT_FALSE(board.good);
  EXPECT_THAT(board.found, HasSubstr(GetParam() > 1 ? "% smaller than its file says" : "% larger than its file says"));
}

INSTANTIATE_TEST_SUITE_P(All, WrongSize, testing::Values(0.97, 1.128, 3.67));

/// A lens that no radial-tangential one draws: a VI-Sensor's.
Result<RigFit> fit_of_other_shape(CameraModel model, double distance_m) {
  WavedRig rig;
  rig.lens = {
      CameraModel::kPinholeEquidistant, 752, 480, {461.3, 461.3, 364.8, 249.0}, {-0.0072, 0.0349, -0.0441, 0.0229}};
  rig.distance_m = distance_m;
  return fit_of(rig, rig.views(), model);
}

TEST(OtherShape, WidensTheSigmas) {
  const auto near = fit_of_other_shape(CameraModel::kPinholeRadialTangential, 0.45),
             far = fit_of_other_shape(CameraModel::kPinholeRadialTangential, 0.8);
  ASSERT_TRUE(near && far);
  const LensStep off = lens_values(near->state.constants.lens) - lens_values(far->state.constants.lens);
  double without = 0;
  for (int i = 0; i < off.size(); ++i) {
    const auto variance = [&](const RigFit& fit) { return fit.uncertainty.covariance(i, i); };
    without = std::max(without, std::abs(off[i]) / std::sqrt(variance(*near) + variance(*far)));
    EXPECT_LT(std::abs(off[i]), 3 * std::hypot(near->sigma(i), far->sigma(i)))
        << lens_column_name(CameraModel::kPinholeRadialTangential, i);
  }
  EXPECT_GT(without, 5) << "the two see different parts of the lens";
  EXPECT_THAT(verdict_on(*near, "lens").found, HasSubstr("because no lens of this model has the true shape"));
}

TEST(OtherShape, IsNotSeenByItsOwnModel) {
  const auto right = fit_of_other_shape(CameraModel::kPinholeEquidistant, 0.45);
  ASSERT_TRUE(right);
  EXPECT_EQ(right->uncertainty.misfit.cols(), 0);
  EXPECT_THAT(verdict_on(*right, "lens").found, Not(HasSubstr("because")));
}

}  // namespace
}  // namespace epiline
