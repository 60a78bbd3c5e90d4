// A real recording of a board: corners of a VI-Sensor's two cameras, 46 s (ASL, via chutsu/yac).
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "drivers/study/calibrate/calibrate.h"
#include "drivers/study/calibrate/calibration_files.h"
#include "drivers/study/replay/replay.h"
#include "drivers/study/report/flight_record.h"
#include "estimator/geometry/so3.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

class RealRig : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(recording())) GTEST_SKIP() << "no recording " << recording();
    settings_.dataset = recording();
    settings_.guess = "none";
    settings_.width = 752;
    settings_.height = 480;
    settings_.duration_s = 15;
  }
  static std::filesystem::path recording() { return test::recorded_data("imu_april_tracks"); }
  /// Once for all tests of the process.
  const Result<Calibration>& found() {
    static const Result<Calibration> calibration = calibrate(settings_);
    return calibration;
  }

  CalibrateSettings settings_;
};

TEST_F(RealRig, IsFoundFromNothing) {
  ASSERT_TRUE(found()) << found().error().text();
  const auto reference = read_camera_calibration(recording() / "mav0" / "cam0" / "sensor.yaml", "cam0");
  ASSERT_TRUE(reference);
  const Calibration& f = *found();
  const auto& [fx, fy, cx, cy] = f.camera.parameters.intrinsics;
  EXPECT_NEAR(fx / fy, 1, 5e-4) << "the sensor's pixels are square";
  EXPECT_NEAR(fx / reference->parameters.intrinsics[0], 1, 0.01);
  EXPECT_LT(so3_log(f.camera.R_BC.transpose() * reference->R_BC).norm(), 0.015);
  EXPECT_LT((f.camera.p_BC - reference->p_BC).norm(), 0.015);
  EXPECT_LT(std::abs(f.camera.time_offset_s), 5e-4);
  EXPECT_LT(f.fit.rms_px, 0.35);
  EXPECT_NE(calibration_html(f, settings_).find("</html>"), std::string::npos);
}

/// Position error of MH_01, flown with the same camera; a calibration that is wrong is not mended in flight. Without
/// one: the data set's.
double flight_error_m(const std::optional<CameraCalibration>& camera) {
  ReplayOptions options;
  options.dataset = test::recorded_data("euroc_MH_01");
  options.set = {"estimator.estimate_extrinsics=false", "estimator.estimate_focal_length=false"};
  if (camera) options.alter = [&](AslDataset& dataset) { dataset.camera = *camera; };
  const auto result = replay(options, [](std::size_t, std::size_t) {});
  if (!result) {
    ADD_FAILURE() << result.error().text();
    return 0;
  }
  return evaluate(trajectory_of(result->record), *result->record.truth).ate_4dof.rmse;
}

TEST_F(RealRig, FliesAsWellAsWithTheShippedCalibration) {
  if (!std::filesystem::exists(test::recorded_data("euroc_MH_01"))) GTEST_SKIP() << "MH_01 is not here";
  ASSERT_TRUE(found()) << found().error().text();
  const double ours = flight_error_m(found()->camera), shipped = flight_error_m(std::nullopt);
  EXPECT_GT(ours, 0);
  EXPECT_LT(ours, 1.02 * shipped);
}

}  // namespace
}  // namespace epiline
