// A real recording of a board: corners of a VI-Sensor's two cameras, 46 s (ASL, via chutsu/yac).
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "drivers/study/calibrate/calibrate.h"
#include "drivers/study/calibrate/calibration_files.h"
#include "estimator/geometry/so3.h"

namespace epiline {
namespace {

std::filesystem::path recording() {
  const char* data = std::getenv("EPILINE_DATA");
  return data == nullptr ? "" : std::filesystem::path(data) / "imu_april_tracks";
}

TEST(Calibration, OfARealRigFromNothing) {
  if (!std::filesystem::exists(recording())) GTEST_SKIP() << "no recording " << recording();
  CalibrateSettings settings;
  settings.dataset = recording();
  settings.guess = "none";
  settings.model = CameraModel::kPinholeRadialTangential;
  settings.width = 752;
  settings.height = 480;
  settings.duration_s = 15;
  const auto found = calibrate(settings);
  ASSERT_TRUE(found) << found.error().text();
  const auto reference = read_camera_calibration(recording() / "mav0" / "cam0" / "sensor.yaml", "cam0");
  ASSERT_TRUE(reference);
  const auto& [fx, fy, cx, cy] = found->camera.parameters.intrinsics;
  EXPECT_NEAR(fx / fy, 1, 5e-4) << "the sensor's pixels are square";
  EXPECT_NEAR(fx / reference->parameters.intrinsics[0], 1, 0.01);
  EXPECT_LT(so3_log(found->camera.R_BC.transpose() * reference->R_BC).norm(), 0.015);
  EXPECT_LT((found->camera.p_BC - reference->p_BC).norm(), 0.015);
  EXPECT_LT(std::abs(found->camera.time_offset_s), 5e-4);
  EXPECT_LT(found->fit.rms_px, 0.35);
  EXPECT_NE(calibration_html(*found, settings).find("</html>"), std::string::npos);
}

}  // namespace
}  // namespace epiline
