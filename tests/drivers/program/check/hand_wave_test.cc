#include "drivers/program/check/hand_wave.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/flights/recordings/image_file.h"
#include "drivers/program/check/image_check.h"
#include "drivers/program/check/imu_check.h"
#include "estimator/geometry/so3.h"
#include "tests/support/recorded_data.h"

namespace epiline {
namespace {

/// Somebody turns a rig; the camera sees far points.
struct MadeUpWave {
  double offset_s = 0.037;  ///< t_IMU = t_image + offset
  Mat3 R_BC = so3_exp(Vec3(0.3, -1.2, 1.9));
  Vec3 bias{0.02, -0.05, 0.03};
  double size = 1, parallax = 0;  ///< rad/s; rad between two images, of points at random depths
  bool one_axis = false, has_readings = true;

  static Vec3 rate_at(double t, bool one_axis) {
    Vec3 w(1.2 * std::sin(3.1 * t), 0.9 * std::sin(4.3 * t + 1), 1.1 * std::sin(2.3 * t + 2));
    if (one_axis) w.tail<2>() *= 0.01;
    return w;
  }

  HandWave wave(HandWave wave = {}) const {
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    std::vector<Vec3> points(80);
    for (Vec3& p : points) p = Vec3(normal(random), normal(random), 2).normalized();
    // attitude of the body by fine steps
    constexpr double kStep = 0.001;
    Mat3 R_WB = Mat3::Identity();
    double next_image = 0.5;
    for (int i = 0; i < 10'000; ++i) {
      const double t = i * kStep;
      const Vec3 w = size * rate_at(t, one_axis);
      if (has_readings && i % 5 == 0) {
        ImuSample s;
        s.stamp = {1'000'000'000 + static_cast<std::int64_t>(t * 1e9)};
        Vec3::Map(s.angular_velocity_rad_s.data()) =
            w + bias + 0.002 * Vec3(normal(random), normal(random), normal(random));
        wave.add_reading(s);
      }
      if (t >= next_image) {  // by the IMU's time
        next_image += 0.05;
        TrackedFrame frame;
        frame.stamp = {1'000'000'000 + static_cast<std::int64_t>((t - offset_s) * 1e9)};
        const Mat3 R_CW = (R_WB * R_BC).transpose();
        for (std::size_t k = 0; k < points.size(); ++k) {
          TrackedFeature f;
          f.id = static_cast<std::uint32_t>(k);
          const Vec3 noise(normal(random), normal(random), normal(random));
          const Vec3 seen = (R_CW * (R_BC * points[k]) + (5e-4 + parallax) * noise).normalized();
          std::copy(seen.data(), seen.data() + 3, f.bearing.begin());
          frame.features.push_back(f);
        }
        wave.add_images(frame);
      }
      R_WB = R_WB * so3_exp(w * kStep);
    }
    return wave;
  }
};

std::string first_text(const Findings& findings) {
  return kGradeNames[static_cast<std::size_t>(findings[0].grade)] + std::string(": ") + findings[0].text + "; " +
         findings[0].remedy;
}

TEST(HandWave, FindsTimeOffsetAndRotation) {
  for (const double offset : {0.037, -0.012, 0.}) {
    MadeUpWave made;
    made.offset_s = offset;
    const HandWaveResult r = made.wave().result();
    EXPECT_NEAR(r.time_offset_s, offset, 0.0015);
    EXPECT_LT(so3_log(made.R_BC.transpose() * r.R_BC).norm(), 0.01);
    EXPECT_GT(r.agreement, 0.99);
    EXPECT_GT(r.weakest_axis, 0.5);
  }
}

TEST(HandWave, SaysWhatIsWrong) {
  const MadeUpWave made;
  const HandWaveResult r = made.wave().result();
  const Findings right = findings_of(r, made.R_BC, made.offset_s);
  for (const Finding& f : right) EXPECT_EQ(f.grade, Grade::kOk) << f.text;
  EXPECT_EQ(findings_of(r, made.R_BC, 0)[0].grade, Grade::kError);
  EXPECT_NE(findings_of(r, made.R_BC, 0)[0].remedy.find("camera.time_offset_s = 0.03"), std::string::npos);
  const Findings inverted = findings_of(r, made.R_BC.transpose(), made.offset_s);
  EXPECT_EQ(inverted[1].grade, Grade::kError);
  EXPECT_NE(inverted[1].remedy.find("axes are swapped"), std::string::npos);
}

TEST(HandWave, SaysWhenItCannotKnow) {
  MadeUpWave still, one_axis, chance;
  still.size = 0.02;
  EXPECT_EQ(first_text(findings_of(still.wave().result(), still.R_BC, 0)).find("warning: not turned"), 0u);
  one_axis.one_axis = true;
  const Findings f = findings_of(one_axis.wave().result(), one_axis.R_BC, one_axis.offset_s);
  EXPECT_EQ(f[0].grade, Grade::kOk) << "the time is known";
  EXPECT_EQ(f[1].grade, Grade::kWarning);
  chance.parallax = 0.5;
  EXPECT_NE(findings_of(chance.wave().result(), chance.R_BC, chance.offset_s)[0].grade, Grade::kOk);
  EXPECT_EQ(findings_of(HandWave().result(), Mat3::Identity(), 0)[0].grade, Grade::kWarning) << "nothing at all";
}

TEST(HandWave, AnHourAtRestBeforeItDoesNotHideIt) {
  const MadeUpWave made;
  HandWave rest;
  ImuSample reading;
  for (std::size_t i = 0; i < 4 * HandWave::kReadings; ++i) {
    reading.stamp = {1'000 * static_cast<std::int64_t>(i)};
    rest.add_reading(reading);
  }
  EXPECT_NEAR(made.wave(std::move(rest)).result().time_offset_s, made.offset_s, 0.0015);
}

TEST(HandWave, WithoutReadingsNothingIsJudged) {
  MadeUpWave made;
  made.has_readings = false;
  EXPECT_EQ(first_text(findings_of(made.wave().result(), made.R_BC, 0)).find("warning: not turned"), 0u);
}

// A real flight, whose camera and IMU are synchronised in hardware and calibrated.
TEST(HandWave, OfARecordedFlightIsAsCalibrated) {
  const std::filesystem::path folder = test::recorded_data("euroc_MH_01");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const auto dataset = open_asl_dataset(folder, "cam0");
  ASSERT_TRUE(dataset) << dataset.error().text();
  ImageCheck images(Camera(dataset->camera.parameters), {});
  ImuCheck readings;
  HandWave wave;
  for (const ImuSample& s : dataset->imu_samples) {
    wave.add_reading(s);
    readings.step(s);
  }
  ImageDecoder decoder;
  for (std::size_t i = 0; i < std::min<std::size_t>(400, dataset->images.size()); ++i) {
    const auto frame = decoder.read(i, *dataset);
    ASSERT_TRUE(frame) << frame.error().text();
    wave.add_images(images.step(*frame));
  }
  const HandWaveResult r = wave.result();
  const double angle = so3_log(dataset->camera.R_BC.transpose() * r.R_BC).norm() * 57.3;
  const ImageResult i = images.result();
  std::printf(
      "offset %.2f ms, rotation off %.2f deg, agreement %.3f, rate %.2f rad/s, weakest %.2f; edges %.2f px, "
      "features %.0f, kept %.3f\n",
      1e3 * r.time_offset_s, angle, r.agreement, r.rate_rad_s, r.weakest_axis, i.edge_width_px, i.features,
      i.kept_share);
  EXPECT_NEAR(r.time_offset_s, dataset->camera.time_offset_s, 0.006);
  EXPECT_LT(angle, 7);
  for (const Finding& f : findings_of(i, 20, 150)) EXPECT_EQ(f.grade, Grade::kOk) << f.text;
  for (const Finding& f : findings_of(readings.result(), {200, 1.7e-4, 2e-3})) {
    std::printf("%s: %s\n", kGradeNames[static_cast<std::size_t>(f.grade)], f.text.c_str());
    EXPECT_NE(f.grade, Grade::kError) << f.text;
  }
}

}  // namespace
}  // namespace epiline
