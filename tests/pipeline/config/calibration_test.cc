#include "pipeline/config/calibration.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/pipeline/config/calibration_files.h"

namespace epiline {
namespace {

using test::calibration_file;
using test::camera_error;
using test::camera_of;
using test::imu_error;
using test::imu_of;

const std::string kUnitPose = "T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";

TEST(CameraCalibration, KalibrAndAslSayTheSame) {
  // A quarter turn about z and a shift; Kalibr writes the inverse, IMU to camera.
  const CameraCalibration asl = camera_of(R"(
T_BS: {cols: 4, rows: 4, data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]}
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375]
distortion_model: equidistant
distortion_coefficients: [0.1, 0.2, 0.3, 0.4]
timeshift_cam_imu: -0.005
)");
  const CameraCalibration kalibr = camera_of(R"(
cam0: {camera_model: omni}
cam1:
  T_cam_imu:
  - [0, 1, 0, -0.2]
  - [-1, 0, 0, 0.1]
  - [0, 0, 1, -0.3]
  - [0, 0, 0, 1]
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]
  distortion_model: equidistant
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  timeshift_cam_imu: -0.005
)",
                                             "cam1");
  for (const CameraCalibration& c : {asl, kalibr}) {
    EXPECT_LT((c.p_BC - Vec3(0.1, 0.2, 0.3)).norm(), 1e-12);
    EXPECT_LT((c.R_BC * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-12);
    EXPECT_EQ(c.parameters.model, CameraModel::kPinholeEquidistant);
    EXPECT_EQ(c.parameters.width, 752);
    EXPECT_EQ(c.parameters.intrinsics, (std::array<double, 4>{458.654, 457.296, 367.215, 248.375}));
    EXPECT_EQ(c.parameters.distortion, (std::array<double, 6>{0.1, 0.2, 0.3, 0.4, 0}));
    EXPECT_DOUBLE_EQ(c.time_offset_s, -0.005);
  }
}

TEST(CameraCalibration, DoubleSphereAndNoDistortion) {
  const std::string head = "%YAML:1.0\n" + kUnitPose + "resolution: [512, 512]\ndistortion_model: none\n";
  const auto sphere = camera_of(head + "camera_model: ds\nintrinsics: [-0.2, 0.6, 190, 191, 255, 256]\n").parameters;
  EXPECT_EQ(sphere.model, CameraModel::kDoubleSphere);
  EXPECT_EQ(sphere.intrinsics, (std::array<double, 4>{190, 191, 255, 256}));
  EXPECT_EQ(sphere.distortion, (std::array<double, 6>{-0.2, 0.6, 0, 0, 0}));
  const auto none = camera_of(head + "camera_model: pinhole\nintrinsics: [190, 191, 255, 256]\n").parameters;
  EXPECT_EQ(none.model, CameraModel::kPinholeRadialTangential);
  EXPECT_EQ(none.distortion, (std::array<double, 6>{}));
}

TEST(CameraCalibration, ATimeOffsetInAnotherUnitIsRefused) {
  const std::string head = kUnitPose +
                           "resolution: [752, 480]\ncamera_model: pinhole\nintrinsics: [458, 457, 367, 248]\n"
                           "distortion_model: none\ntimeshift_cam_imu: ";
  for (const char* offset : {"-5.2", "5200000"})
    EXPECT_EQ(camera_error(head + offset).find(":6: timeshift_cam_imu of more than a second; expected seconds"), 0u);
  EXPECT_EQ(camera_error(head + "-0.0052"), "read");
}

// Each with the line of the file, what stands there, and what was expected.
TEST(CameraCalibration, SaysWhatIsWrongWithALens) {
  const auto error = [](const std::string& resolution, const std::string& lens) {
    return camera_error(kUnitPose + "resolution: " + resolution + "\n" + lens);
  };
  const std::string size = "[512, 512]", none = "distortion_model: none\n", pinhole = "camera_model: pinhole\n",
                    good = "intrinsics: [190, 191, 255, 256]\n";
  EXPECT_EQ(error(size, pinhole + good + none), "read");
  EXPECT_EQ(error(size, "camera_model: fisheye\n" + good + none),
            ":3: unknown camera model \"fisheye\"; expected pinhole, double-sphere (ds), eucm or omni");
  EXPECT_EQ(error(size, pinhole + "intrinsics: [190, 191, 255]\n" + none), ":4: 3 numbers; expected 4: fu fv cu cv");
  EXPECT_EQ(error(size, pinhole + "intrinsics: [190, wide, 255, 256]\n" + none),
            ":4: \"wide\"; expected a finite number");
  EXPECT_EQ(error(size, pinhole + "intrinsics: [190, .nan, 255, 256]\n" + none),
            ":4: \".nan\"; expected a finite number");
  EXPECT_EQ(error(size, pinhole + "intrinsics: [190, 0, 255, 256]\n" + none),
            ":4: a focal length that is not above zero; expected pixels");
  const std::string sphere = "camera_model: ds\nintrinsics: [-0.2, 1.6, 190, 191, 255, 256]\n";
  EXPECT_EQ(error(size, sphere + none), ":4: alpha outside 0 to 1; expected xi alpha fu fv cu cv");
  EXPECT_EQ(error(size,
                  "camera_model: ds\nintrinsics: [-0.2, 0.6, 190, 191, 255, 256]\ndistortion_model: radtan\n"
                  "distortion_coeffs: [0, 0, 0, 0]\n"),
            ":5: distortion model \"radtan\" with a double sphere; expected none");
  EXPECT_EQ(error(size, pinhole + good + "distortion_model: fov\ndistortion_coeffs: [0.9]\n"),
            ":5: unknown distortion model \"fov\"; expected radial-tangential, equidistant or none");
  EXPECT_EQ(error(size, pinhole + good + "distortion_model: radtan\ndistortion_coeffs: [0.9]\n"),
            ":6: 1 number; expected 4 or 5: k1 k2 p1 p2 [k3]");
  for (const char* const wrong : {"[512.5, 512]", "[0, 512]", "[512, 99999]"})
    EXPECT_EQ(error(wrong, pinhole + good + none), ":2: not an image size; expected width height in pixels");
}

TEST(ImuCalibration, ReadsDensitiesAndRefusesAnImuThatIsNotTheBody) {
  const std::string densities =
      "gyroscope_noise_density: 1e-4\ngyroscope_random_walk: 2e-5\naccelerometer_noise_density: "
      "3e-3\naccelerometer_random_walk: 4e-3\n";
  const ImuCalibration imu = imu_of(densities + "gyroscope_saturation: 34\n");
  EXPECT_DOUBLE_EQ(imu.noise.gyroscope_density, 1e-4);
  EXPECT_DOUBLE_EQ(imu.noise.gyroscope_random_walk, 2e-5);
  EXPECT_DOUBLE_EQ(imu.noise.accelerometer_density, 3e-3);
  EXPECT_DOUBLE_EQ(imu.noise.accelerometer_random_walk, 4e-3);
  EXPECT_DOUBLE_EQ(*imu.saturation_gyroscope_rad_s, 34);
  EXPECT_FALSE(imu.saturation_accelerometer_m_s2);
  const std::string turned = densities + "T_BS: [0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  EXPECT_EQ(imu_error(turned).find(":5: the IMU is not the body frame"), 0u);
  EXPECT_NE(imu_error("gyroscope_noise_density: -1\n"), "read");
}

TEST(ImuCalibration, ReadsWhatKalibrWrites) {
  const std::string written = R"(imu0:
  T_i_b:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  accelerometer_noise_density: 0.01
  accelerometer_random_walk: 0.0002
  gyroscope_noise_density: 0.005
  gyroscope_random_walk: 4.0e-06
  model: calibrated
  rostopic: /imu0
  time_offset: 0.0
  update_rate: 200.0
)";
  const ImuNoise noise = imu_of(written).noise;
  EXPECT_DOUBLE_EQ(noise.gyroscope_density, 0.005);
  EXPECT_DOUBLE_EQ(noise.gyroscope_random_walk, 4e-6);
  EXPECT_DOUBLE_EQ(noise.accelerometer_density, 0.01);
  EXPECT_DOUBLE_EQ(noise.accelerometer_random_walk, 2e-4);
  std::string second = written;
  second.replace(second.find("- [1.0"), 6, "- [1.1");
  EXPECT_NE(imu_error(second), "read");
}

// With anchors a list can hold itself, or a few lines can say millions of numbers.
TEST(CameraCalibration, RefusesListsWithoutEnd) {
  const std::string head = kUnitPose + "resolution: [512, 512]\ncamera_model: pinhole\ndistortion_model: none\n";
  EXPECT_EQ(camera_error(head + "intrinsics: &a [*a]\n").find(":5: "), 0u);
  std::string wide = "many: &a [1";
  for (int i = 0; i < 3000; ++i) wide += ", 1";
  wide += "]\nintrinsics: [*a";
  for (int i = 0; i < 3000; ++i) wide += ", *a";
  EXPECT_NE(camera_error(head + wide + "]\n"), "read");
}

TEST(UncalibratedSensor, IsOneWithATypeAndNoKeyOfACalibration) {
  const auto is_one = [](const std::string& text) {
    return holds_no_calibration(calibration_file("uncalibrated.yaml", text));
  };
  EXPECT_TRUE(is_one("sensor_type: camera\nrate_hz: 20\nresolution: [752, 480]\n"));
  EXPECT_TRUE(is_one("sensor_type: imu\nrate_hz: 200\n"));
  // what is there in part is a mistake that its reader names
  EXPECT_FALSE(is_one("sensor_type: camera\nintrinsics: [1, 2, 3, 4]\n"));
  EXPECT_FALSE(is_one("sensor_type: imu\ngyroscope_noise_density: 1e-3\n"));
  EXPECT_FALSE(is_one("resolution: [752, 480]\n"));
  EXPECT_FALSE(is_one("cam0: {sensor_type: camera}\n"));
  EXPECT_FALSE(is_one("sensor_type: [\n"));
  EXPECT_FALSE(holds_no_calibration("/does/not/exist.yaml"));
}

}  // namespace
}  // namespace epiline
