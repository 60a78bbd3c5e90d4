// Calibrations as other programs keep them: each small file is in the layout of its program, and seen to give the
// pixels that the program's own model gives.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "pipeline/config/asl.h"
#include "tests/pipeline/config/calibration_files.h"

namespace epiline {
namespace {

using test::calibration_file;
using test::camera_error;
using test::camera_of;
using test::imu_error;
using test::imu_of;

/// `expected`: the pixel of a point, by the program's own model.
template <class Expected>
void expect_pixels(const CameraCalibration& c, const Expected& expected) {
  const Camera camera(c.parameters);
  ASSERT_EQ(fault_of(c.parameters), CameraFault::kNone);
  for (const Vec3& p : {Vec3(0, 0, 1), Vec3(0.3, -0.2, 1), Vec3(-1.2, 0.9, 2.1), Vec3(0.5, 0.45, 0.9)}) {
    Vec2 px;
    ASSERT_TRUE(camera.project(p, px));
    EXPECT_LT((px - expected(p)).norm(), 1e-9) << p.transpose();
  }
}

Vec2 radial_tangential(const Vec2& m, double k1, double k2, double p1, double p2) {
  const double x = m.x(), y = m.y(), s = m.squaredNorm(), radial = 1 + k1 * s + k2 * s * s;
  return {x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y};
}

Vec2 equidistant(const Vec3& p, double k1, double k2, double k3, double k4) {
  const double theta = std::atan2(p.head<2>().norm(), p.z()), s = theta * theta,
               r = theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))));
  return p.head<2>().norm() > 0 ? Vec2(r * p.head<2>().normalized()) : Vec2::Zero();
}

Vec2 mei(const Vec3& p, double xi, double k1, double k2, double p1, double p2) {
  return radial_tangential(p.head<2>() / (p.z() + xi * p.norm()), k1, k2, p1, p2);
}

void expect_quarter_turn(const CameraCalibration& c, const Vec3& p_BC) {
  EXPECT_LT((c.R_BC * Vec3::UnitX() - Vec3::UnitY()).norm(), 1e-9);
  EXPECT_LT((c.p_BC - p_BC).norm(), 1e-9);
}

const std::string kPose = R"( !!opencv-matrix
   rows: 4
   cols: 4
   dt: d
   data: [0, -1, 0, 0.1, 1, 0, 0, 0.2,
          0, 0, 1, 0.3, 0, 0, 0, 1]
)";
const std::string kKannala = R"(model_type: KANNALA_BRANDT
camera_name: camera
image_width: 752
image_height: 480
projection_parameters:
   k2: -0.01
   k3: 0.02
   k4: -0.02
   k5: 0.005
   mu: 458.6
   mv: 457.3
   u0: 367.2
   v0: 248.4
)";

TEST(ForeignCalibration, CamOdoCal) {
  const auto kannala = camera_of("%YAML:1.0\n---\n" + kKannala + "T_BS:" + kPose);
  expect_quarter_turn(kannala, {0.1, 0.2, 0.3});
  expect_pixels(kannala, [](const Vec3& p) {
    const Vec2 d = equidistant(p, -0.01, 0.02, -0.02, 0.005);
    return Vec2(458.6 * d.x() + 367.2, 457.3 * d.y() + 248.4);
  });
  EXPECT_EQ(camera_error(kKannala),
            ": a file of CamOdoCal: the key `T_BS` is missing; expected the camera's pose on the IMU beside the lens: "
            "T_BS, T_imu_cam or T_cam_imu, a 4x4 matrix");
  EXPECT_EQ(camera_error("model_type: SCARAMUZZA\nimage_width: 752\nimage_height: 480\nprojection_parameters: {}\n"),
            ":1: a file of CamOdoCal: the lens model SCARAMUZZA; expected PINHOLE, KANNALA_BRANDT or MEI");
  EXPECT_EQ(imu_error(kKannala),
            ":1: a file of CamOdoCal: it holds no IMU; expected Kalibr's imu.yaml, or one of "
            "another format");
}

TEST(ForeignCalibration, VinsFindsTheLensBesideItsFile) {
  calibration_file("lens.yaml", R"(%YAML:1.0
---
model_type: MEI
image_width: 752
image_height: 480
mirror_parameters:
   xi: 1.45
distortion_parameters:
   k1: -0.34
   k2: 0.06
   p1: 0.00126
   p2: -0.00021
projection_parameters:
   gamma1: 896
   gamma2: 897
   u0: 372
   v0: 238
)");
  const std::string fusion =
      "%YAML:1.0\n\nimu: 1\nacc_n: 0.1\ncam0_calib: \"epiline_lens.yaml\"\nbody_T_cam0:" + kPose + "td: -0.004\n";
  const auto camera = camera_of(fusion);
  expect_quarter_turn(camera, {0.1, 0.2, 0.3});
  EXPECT_DOUBLE_EQ(camera.time_offset_s, -0.004);
  expect_pixels(camera, [](const Vec3& p) {
    const Vec2 d = mei(p, 1.45, -0.34, 0.06, 0.00126, -0.00021);
    return Vec2(896 * d.x() + 372, 897 * d.y() + 238);
  });
  EXPECT_EQ(camera_error(fusion, "cam1"), ": a file of VINS: the key `body_T_cam1` is missing; expected this key");
  EXPECT_EQ(imu_error(fusion),
            ":4: a file of VINS: acc_n and gyr_n are the noise of one reading, and enlarged; "
            "expected densities: gyroscope_noise_density and so on, as in Kalibr's imu.yaml");
  EXPECT_FALSE(is_chain_with(calibration_file("camera.yaml", fusion), "cam1"));

  const auto mono = camera_of("%YAML:1.0\n" + kKannala + R"(extrinsicRotation: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [0, -1, 0, 1, 0, 0, 0, 0, 1]
extrinsicTranslation: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [0.1, 0.2, 0.3]
)");
  expect_quarter_turn(mono, {0.1, 0.2, 0.3});
  EXPECT_EQ(mono.parameters.model, CameraModel::kPinholeEquidistant);
}

TEST(ForeignCalibration, OrbSlam) {
  const std::string head = "%YAML:1.0\nCamera.width: 752\nCamera.height: 480\n",
                    imu = "IMU.NoiseGyro: 1.7e-4\nIMU.NoiseAcc: 2e-3\nIMU.GyroWalk: 1.9e-5\nIMU.AccWalk: 3e-3\n";
  const std::string version_1 = head +
                                "File.version: \"1.0\"\nCamera.type: \"PinHole\"\nCamera1.fx: 458.6\n"
                                "Camera1.fy: 457.3\nCamera1.cx: 367.2\nCamera1.cy: 248.4\nCamera1.k1: -0.28\n"
                                "Camera1.k2: 0.07\nCamera1.p1: 0.0002\nCamera1.p2: 0.00002\nIMU.T_b_c1:" +
                                kPose + imu;
  const auto camera = camera_of(version_1);
  expect_quarter_turn(camera, {0.1, 0.2, 0.3});
  expect_pixels(camera, [](const Vec3& p) {
    const Vec2 d = radial_tangential(p.head<2>() / p.z(), -0.28, 0.07, 0.0002, 0.00002);
    return Vec2(458.6 * d.x() + 367.2, 457.3 * d.y() + 248.4);
  });
  const ImuNoise noise = imu_of(version_1).noise;
  EXPECT_DOUBLE_EQ(noise.gyroscope_density, 1.7e-4);
  EXPECT_DOUBLE_EQ(noise.gyroscope_random_walk, 1.9e-5);
  EXPECT_DOUBLE_EQ(noise.accelerometer_density, 2e-3);
  EXPECT_DOUBLE_EQ(noise.accelerometer_random_walk, 3e-3);

  const std::string before = head +
                             "Camera.type: \"KannalaBrandt8\"\nCamera.fx: 190\nCamera.fy: 191\nCamera.cx: 254\n"
                             "Camera.cy: 256\nCamera.k1: 0.003\nCamera.k2: 0.0007\nCamera.k3: -0.002\n"
                             "Camera.k4: 0.0002\nTbc:" +
                             kPose +
                             "Camera2.fx: 190\nCamera2.fy: 191\nCamera2.cx: 252\nCamera2.cy: 255\nCamera2.k1: 0.003\n"
                             "Camera2.k2: 0.0007\nCamera2.k3: -0.002\nCamera2.k4: 0.0002\n"
                             "Tlr: !!opencv-matrix\n   rows: 3\n   data: [1, 0, 0, 0.11, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, "
                             "0, 1]\n";
  expect_pixels(camera_of(before), [](const Vec3& p) {
    const Vec2 d = equidistant(p, 0.003, 0.0007, -0.002, 0.0002);
    return Vec2(190 * d.x() + 254, 191 * d.y() + 256);
  });
  expect_quarter_turn(camera_of(before, "cam1"), {0.1, 0.31, 0.3});
  EXPECT_TRUE(is_chain_with(calibration_file("camera.yaml", before), "cam1"));
  EXPECT_EQ(camera_error(head + "Camera.type: \"PinHole\"\nCamera.fx: 458\n"),
            ": a file of ORB-SLAM3: the key `Camera.fy` is missing; expected this key");
  // without them it is not said whether the images are rectified
  std::string undistorted = version_1;
  undistorted.erase(undistorted.find("Camera1.k1"), 18);
  EXPECT_EQ(camera_error(undistorted), ": a file of ORB-SLAM3: the key `Camera1.k1` is missing; expected this key");
}

TEST(ForeignCalibration, RosCameraInfo) {
  const auto info = [](const std::string& model, const std::string& coefficients) {
    return "image_width: 752\nimage_height: 480\ncamera_name: cam\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: "
           "[458.6, "
           "0, 367.2, 0, 457.3, 248.4, 0, 0, 1]\ndistortion_model: " +
           model + "\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: " + coefficients + "\n";
  };
  const auto camera = camera_of(info("plumb_bob", "[-0.28, 0.07, 0.0002, 0.00002, 0]") + "T_imu_cam:" + kPose);
  expect_quarter_turn(camera, {0.1, 0.2, 0.3});
  expect_pixels(camera, [](const Vec3& p) {
    const Vec2 d = radial_tangential(p.head<2>() / p.z(), -0.28, 0.07, 0.0002, 0.00002);
    return Vec2(458.6 * d.x() + 367.2, 457.3 * d.y() + 248.4);
  });
  EXPECT_EQ(camera_of(info("rational_polynomial", "[-0.28, 0.07, 0, 0, 0.01, 0, 0, 0]") + "T_BS:" + kPose)
                .parameters.distortion[4],
            0.01);
  EXPECT_EQ(
      camera_error(info("rational_polynomial", "[-0.28, 0.07, 0, 0, 0.01, 0.2, 0, 0]") + "T_BS:" + kPose),
      ":10: a file of ROS (CameraInfo): a lens with k4, k5, k6 (rational polynomial); expected k1 k2 p1 p2 k3, or "
      "an equidistant lens; `epiline calibrate` finds one");
  EXPECT_EQ(
      camera_error(info("plumb_bob", "[-0.28, 0.07, 0, 0, 0]")).find(": a file of ROS (CameraInfo): the key `T_BS`"),
      0u);
  const auto printed = camera_of(
      "height: 480\nwidth: 752\ndistortion_model: equidistant\nd: [0.01, 0.02, 0.03, 0.004]\nk: [458.6, 0, 367.2, 0, "
      "457.3, 248.4, 0, 0, 1]\nT_BS:" +
      kPose);
  EXPECT_EQ(printed.parameters.model, CameraModel::kPinholeEquidistant);
}

std::string basalt(const std::string& lens) {
  return R"({"value0": {"T_imu_cam": [{"px": 0.1, "py": 0.2, "pz": 0.3, "qx": 0, "qy": 0, "qz": 0.7071067811865476,
    "qw": 0.7071067811865476}], "intrinsics": [{)" +
         lens + R"(}], "resolution": [[752, 480]], "cam_time_offset_ns": 2124029,
    "calib_accel_bias": [1, 2, 3, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06],
    "calib_gyro_bias": [1, 2, 3, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09],
    "accel_noise_std": [0.008, 0.009, 0.007], "gyro_noise_std": 0.002, "accel_bias_std": 0.01,
    "gyro_bias_std": 0.0007}})";
}

TEST(ForeignCalibration, Basalt) {
  const auto enhanced = camera_of(basalt(
      R"("camera_type": "eucm", "intrinsics": {"fx": 460.8, "fy": 459.4, "cx": 365.9, "cy": 249.3, "alpha": 0.59, "beta": 1.13})"));
  expect_quarter_turn(enhanced, {0.1, 0.2, 0.3});
  EXPECT_DOUBLE_EQ(enhanced.time_offset_s, 2.124029e-3);
  expect_pixels(enhanced, [](const Vec3& p) {
    const double n = 0.59 * std::sqrt(1.13 * p.head<2>().squaredNorm() + p.z() * p.z()) + 0.41 * p.z();
    return Vec2(460.8 * p.x() / n + 365.9, 459.4 * p.y() / n + 249.3);
  });
  const std::string sphere =
      R"("camera_type": "ds", "intrinsics": {"fx": 350, "fy": 349, "cx": 367.2, "cy": 248.4, "xi": -0.24, "alpha": 0.57})";
  EXPECT_EQ(camera_of(basalt(sphere)).parameters.distortion[1], 0.57);
  EXPECT_EQ(camera_error(basalt(sphere), "cam1"),
            ":2: a file of basalt: no cam1 in resolution; expected one entry for each camera");
  EXPECT_EQ(camera_error(
                basalt(R"("camera_type": "fov", "intrinsics": {"fx": 350, "fy": 349, "cx": 367, "cy": 248, "w": 1})")),
            ":2: a file of basalt: the lens model fov; expected ds, eucm, kb4, pinhole or pinhole-radtan8");
  const ImuCalibration imu = imu_of(basalt(sphere));
  EXPECT_DOUBLE_EQ(imu.noise.accelerometer_density, 0.009);
  EXPECT_DOUBLE_EQ(imu.noise.gyroscope_random_walk, 0.0007);
  Mat3 accelerometer, gyroscope;
  accelerometer << 1.01, 0, 0, 0.02, 1.04, 0, 0.03, 0.05, 1.06;
  gyroscope << 1.01, 0.04, 0.07, 0.02, 1.05, 0.08, 0.03, 0.06, 1.09;
  EXPECT_TRUE(imu.correction.accelerometer.isApprox(accelerometer, 1e-12));
  EXPECT_TRUE(imu.correction.gyroscope.isApprox(gyroscope, 1e-12));
}

TEST(ForeignCalibration, KalibrsOmniAndEucm) {
  const std::string head =
      "cam0:\n  T_imu_cam: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n  resolution: "
      "[752, 480]\n";
  const auto omni = camera_of(head +
                              "  camera_model: omni\n  intrinsics: [0.8, 833.0, 830.3, 373.8, 253.7]\n"
                              "  distortion_model: radtan\n  distortion_coeffs: [-0.335, 0.132, 0.00056, 0.00058]\n");
  expect_pixels(omni, [](const Vec3& p) {
    const Vec2 d = mei(p, 0.8, -0.335, 0.132, 0.00056, 0.00058);
    return Vec2(833.0 * d.x() + 373.8, 830.3 * d.y() + 253.7);
  });
  const auto enhanced = camera_of(head +
                                  "  camera_model: eucm\n  intrinsics: [0.59, 1.13, 460.8, 459.4, 365.9, 249.3]\n"
                                  "  distortion_model: none\n  distortion_coeffs: []\n");
  expect_pixels(enhanced, [](const Vec3& p) {
    const double n = 0.59 * std::sqrt(1.13 * p.head<2>().squaredNorm() + p.z() * p.z()) + 0.41 * p.z();
    return Vec2(460.8 * p.x() / n + 365.9, 459.4 * p.y() / n + 249.3);
  });
  // what a recording of such a flight says is read again, bit by bit
  for (const CameraCalibration& c : {omni, enhanced}) {
    const CameraParameters again = camera_of(asl_camera(c, 20, "")).parameters;
    EXPECT_EQ(again.model, CameraModel::kUnified);
    EXPECT_EQ(again.intrinsics, c.parameters.intrinsics);
    EXPECT_EQ(again.distortion, c.parameters.distortion);
  }
}

TEST(ForeignCalibration, OpenVinsNamesItsTwoFiles) {
  calibration_file("chain.yaml",
                   "cam1:\n  T_cam_imu: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n  resolution: [64, 48]\n"
                   "  camera_model: pinhole\n  intrinsics: [40, 40, 32, 24]\n  distortion_model: none\n");
  const std::string main =
      "%YAML:1.0\nverbosity: \"INFO\"\nrelative_config_imu: \"epiline_imu.yaml\"\nrelative_config_imucam: "
      "\"epiline_chain.yaml\"\n";
  EXPECT_EQ(camera_of(main, "cam1").parameters.width, 64);
}

}  // namespace
}  // namespace epiline
