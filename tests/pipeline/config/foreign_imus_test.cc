// Errors of an IMU's scales and axes as other programs keep them: readings that have them become the true ones.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <functional>
#include <string>

#include "pipeline/config/asl.h"
#include "tests/pipeline/config/calibration_files.h"

namespace epiline {
namespace {

using test::imu_error;
using test::imu_of;

const std::string kImu =
    "imu0:\n  accelerometer_noise_density: 0.002\n  accelerometer_random_walk: 0.003\n  gyroscope_noise_density: "
    "0.0002\n"
    "  gyroscope_random_walk: 2.0e-05\n";

Mat3 matrix(std::initializer_list<double> rows) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.begin());
}

// Readings with the errors that the file tells become the true ones.
void expect_corrected(const std::string& text, const std::function<ImuSample(const Vec3& w, const Vec3& f)>& reading) {
  const ImuCalibration imu = imu_of(text);
  EXPECT_FALSE(imu.correction.is_none());
  const Vec3 w(0.3, -0.7, 1.1), f(0.5, -9.1, 3.3);
  ImuSample sample = reading(w, f);
  imu.correction.apply(sample);
  EXPECT_LT((vec3(sample.angular_velocity_rad_s) - w).norm(), 1e-12);
  EXPECT_LT((vec3(sample.specific_force_m_s2) - f).norm(), 1e-12);
  // a recording of such an IMU keeps raw readings, and its file the correction
  const ImuCorrection again = imu_of(asl_imu(imu)).correction;
  EXPECT_TRUE(again.gyroscope.isApprox(imu.correction.gyroscope, 1e-12));
  EXPECT_TRUE(again.accelerometer.isApprox(imu.correction.accelerometer, 1e-12));
  EXPECT_TRUE(again.gyroscope_by_force.isApprox(imu.correction.gyroscope_by_force, 1e-9));
}

ImuSample sample_of(const Vec3& w, const Vec3& f) { return {{}, {w.x(), w.y(), w.z()}, {f.x(), f.y(), f.z()}}; }

const Mat3 kMa = matrix({1.02, 0, 0, 0.01, 1.03, 0, -0.012, 0.015, 0.98}),
           kMg = matrix({1.01, 0, 0, 0.006, 0.985, 0, -0.004, 0.003, 1.012}), kC = matrix({0, 1, 0, -1, 0, 0, 0, 0, 1}),
           kA = matrix({1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4, 7e-4, 8e-4, 9e-4});

TEST(ImuIntrinsics, KalibrsAreApplied) {
  expect_corrected(kImu + R"(  accelerometers:
    M:
    - [1.02, 0, 0]
    - [0.01, 1.03, 0]
    - [-0.012, 0.015, 0.98]
  gyroscopes:
    A: [[1.0e-4, 2.0e-4, 3.0e-4], [4.0e-4, 5.0e-4, 6.0e-4], [7.0e-4, 8.0e-4, 9.0e-4]]
    C_gyro_i: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    M: [[1.01, 0, 0], [0.006, 0.985, 0], [-0.004, 0.003, 1.012]]
  model: scale-misalignment
)",
                   [](const Vec3& w, const Vec3& f) { return sample_of(kMg * kC * w + kA * kC * f, kMa * f); });
}

TEST(ImuIntrinsics, OpenVinsAreApplied) {
  expect_corrected(kImu + R"(  model: "kalibr"
  Tw: [[1.01, 0, 0], [0.006, 0.985, 0], [-0.004, 0.003, 1.012]]
  R_IMUtoGYRO: [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
  Ta: [[1.02, 0, 0], [0.01, 1.03, 0], [-0.012, 0.015, 0.98]]
  R_IMUtoACC: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
  Tg: [[1.0e-4, 2.0e-4, 3.0e-4], [4.0e-4, 5.0e-4, 6.0e-4], [7.0e-4, 8.0e-4, 9.0e-4]]
)",
                   [](const Vec3& w, const Vec3& f) { return sample_of(kMg * kC * w + kA * f, kMa * f); });
}

TEST(ImuIntrinsics, WhatCannotBeAppliedIsNamed) {
  EXPECT_EQ(
      imu_error(kImu + "  accelerometers:\n    rx_i: [0, 0, 0]\n    ry_i: [0.01, 0, 0]\n"),
      ":8: the key `ry_i`: accelerometers apart from each other; expected Kalibr's model scale-misalignment, which "
      "has one place for all three");
  EXPECT_EQ(imu_error(kImu + "  gyroscopes:\n    M: [[1, 0, 0], [0, 0, 0], [0, 0, 1]]\n"),
            ": a matrix of the IMU's scales without an inverse; expected matrices near the identity, or turns");
  EXPECT_TRUE(imu_of(kImu + "  Tw: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n").correction.is_none());
}

}  // namespace
}  // namespace epiline
