#include "pipeline/config/asl.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <random>

#include "pipeline/text/table.h"
#include "tests/pipeline/config/calibration_files.h"

namespace epiline {
namespace {

template <class A, class B>
bool same_bits(const A& a, const B& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

// A record of a flight is replayed to the same trajectory only if what was written is what is read, bit by bit.
TEST(Asl, CalibrationIsReadAsItWasWritten) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1, 1);
  for (int i = 0; i < 200; ++i) {
    CameraCalibration camera;
    camera.R_BC = Eigen::Quaterniond(number(random), number(random), number(random), number(random))
                      .normalized()
                      .toRotationMatrix();
    camera.p_BC = Vec3(number(random), number(random), number(random));
    camera.time_offset_s = 0.01 * number(random);
    CameraParameters& p = camera.parameters;
    p.model = static_cast<CameraModel>(i % 3);
    p.width = 752;
    p.height = 480;
    p.intrinsics = {458 + number(random), 457 + number(random), 367 + number(random), 248 + number(random)};
    for (double& d : p.distortion) d = 0.1 * number(random);
    p.distortion[5] = 0;
    if (p.model == CameraModel::kDoubleSphere) p.distortion = {number(random), std::abs(number(random))};
    if (p.model == CameraModel::kPinholeEquidistant || i % 6 == 0) p.distortion[4] = 0;
    const CameraCalibration read = test::camera_of(asl_camera(camera, 20, "made up: numbers"));
    ASSERT_TRUE(same_bits(read.R_BC, camera.R_BC)) << i;
    ASSERT_TRUE(same_bits(read.p_BC, camera.p_BC)) << i;
    ASSERT_EQ(read.time_offset_s, camera.time_offset_s);
    ASSERT_EQ(read.parameters.model, p.model);
    ASSERT_EQ(read.parameters.width, p.width);
    ASSERT_EQ(read.parameters.intrinsics, p.intrinsics);
    ASSERT_EQ(read.parameters.distortion, p.distortion) << i;
  }
}

TEST(Asl, ImuIsReadAsItWasWritten) {
  ImuCalibration imu;
  imu.noise = {1.0 / 3, 2e-5 / 3, 1e-3 / 7, 1e-4 / 9};
  imu.saturation_accelerometer_m_s2 = 100.0 / 3;
  const ImuCalibration read = test::imu_of(asl_imu(imu));
  EXPECT_EQ(read.noise.gyroscope_density, imu.noise.gyroscope_density);
  EXPECT_EQ(read.noise.gyroscope_random_walk, imu.noise.gyroscope_random_walk);
  EXPECT_EQ(read.noise.accelerometer_density, imu.noise.accelerometer_density);
  EXPECT_EQ(read.noise.accelerometer_random_walk, imu.noise.accelerometer_random_walk);
  EXPECT_EQ(read.saturation_accelerometer_m_s2, imu.saturation_accelerometer_m_s2);
  EXPECT_FALSE(read.saturation_gyroscope_rad_s);

  std::mt19937_64 random(6);
  std::normal_distribution<double> number(0, 10);
  std::string text = kAslImuHeader;
  std::vector<ImuSample> samples;
  for (int i = 0; i < 1000; ++i) {
    samples.push_back({HostStamp{static_cast<std::int64_t>(random() >> 2)},
                       {number(random), number(random) * 1e-12, -0.0},
                       {number(random), number(random) * 1e12, number(random)}});
    append_asl_imu(text, samples.back());
  }
  const auto table = parse_table(text, "text", TimeColumn::kNanoseconds, {7}, "IMU sample");
  ASSERT_TRUE(table) << table.error().text();
  ASSERT_EQ(table->rows(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(table->time_ns[i], samples[i].stamp.ns);
    ASSERT_EQ(std::memcmp(table->row(i), samples[i].angular_velocity_rad_s.data(), 3 * sizeof(double)), 0) << i;
    ASSERT_EQ(std::memcmp(table->row(i) + 3, samples[i].specific_force_m_s2.data(), 3 * sizeof(double)), 0) << i;
  }
}

}  // namespace
}  // namespace epiline
