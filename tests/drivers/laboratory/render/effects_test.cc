#include "drivers/laboratory/render/effects.h"

#include <gtest/gtest.h>

namespace epiline {
namespace {

TEST(Effects, OnlyWhatIsNamedIsOn) {
  const auto e = parse_effects("blur=6,noise,rolling-shutter=-30,drops=0.1,moving=2");
  ASSERT_TRUE(e) << e.error().text();
  EXPECT_DOUBLE_EQ(e->camera.exposure_s, 6e-3);
  EXPECT_DOUBLE_EQ(e->camera.read_sigma, CameraEffects{}.read_sigma);
  EXPECT_DOUBLE_EQ(e->camera.row_time_s, -30e-6);
  EXPECT_DOUBLE_EQ(e->dropped_share, 0.1);
  EXPECT_EQ(e->movers, 2);
  EXPECT_EQ(e->camera.vignette, 0);
  EXPECT_FALSE(e->camera.auto_exposure);
  const auto none = parse_effects("none");
  ASSERT_TRUE(none);
  EXPECT_EQ(none->camera.exposure_s, 0);
  EXPECT_EQ(none->camera.read_sigma, 0);
  EXPECT_EQ(none->dropped_share, 0);
}

TEST(Effects, TheUsualOnesAreTheDefaults) {
  const auto e = parse_effects(kUsualEffects);
  ASSERT_TRUE(e);
  const CameraEffects usual;
  EXPECT_DOUBLE_EQ(e->camera.exposure_s, usual.exposure_s);
  EXPECT_DOUBLE_EQ(e->camera.vignette, usual.vignette);
  EXPECT_DOUBLE_EQ(e->camera.read_sigma, usual.read_sigma);
  EXPECT_DOUBLE_EQ(e->camera.shot_factor, usual.shot_factor);
  EXPECT_DOUBLE_EQ(e->camera.lens_blur_px, usual.lens_blur_px);
  EXPECT_EQ(e->camera.auto_exposure, usual.auto_exposure);
}

TEST(Effects, ReachTheSimulatedImu) {
  const auto e = parse_effects(
      "imu-noise=2,imu-bias=0,imu-scale=1,imu-axes=0.5,imu-vibration=90,imu-rate-limit=180,imu-force-limit=4");
  ASSERT_TRUE(e) << e.error().text();
  const ImuNoise noise;
  const ImuModel m = imu_model_with(e->imu, noise, 400, Random(1, 0));
  EXPECT_EQ(m.rate_hz, 400);
  EXPECT_DOUBLE_EQ(m.noise.gyroscope_density, 2 * noise.gyroscope_density);
  EXPECT_DOUBLE_EQ(m.noise.accelerometer_random_walk, 2 * noise.accelerometer_random_walk);
  EXPECT_EQ(m.gyroscope_bias_sigma, 0);
  EXPECT_EQ(m.accelerometer_bias_sigma, 0);
  EXPECT_GT((m.gyroscope_matrix - Mat3::Identity()).norm(), 1e-3);
  EXPECT_LT((m.gyroscope_matrix - Mat3::Identity()).norm(), 0.1);
  EXPECT_FALSE(m.gyroscope_matrix.isApprox(m.accelerometer_matrix));
  ASSERT_EQ(m.vibrations.size(), 1U);
  EXPECT_EQ(m.vibrations[0].frequency_hz, 90);
  EXPECT_NEAR(m.gyroscope_limit_rad_s, 3.14159, 1e-4);
  EXPECT_NEAR(m.accelerometer_limit_m_s2, 39.2266, 1e-4);
}

TEST(Effects, SaysWhatIsWrong) {
  for (const char* bad : {"", "blurr", "blur=", "blur=x", "blur=-1", "drops=2", "noise,,blur", "none,blur"}) {
    const auto e = parse_effects(bad);
    ASSERT_FALSE(e) << bad;
    EXPECT_EQ(e.error().kind, ErrorKind::kUsage);
    EXPECT_NE(e.error().text().find("expected"), std::string::npos) << e.error().text();
  }
}

}  // namespace
}  // namespace epiline
