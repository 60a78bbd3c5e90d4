// Calibrations as programs other than Kalibr keep them.
#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>
#include <vector>

#include "pipeline/config/calibration_formats.h"

namespace epiline {

namespace {

using Keys = std::initializer_list<const char*>;

/// cam1: 1.
std::size_t index_of(const std::string& camera) {
  return camera.size() == 4 && camera[3] >= '0' && camera[3] <= '9' ? static_cast<std::size_t>(camera[3] - '0') : 0;
}

void set_size(const YamlFile& file, const YAML::Node& width, const YAML::Node& height, CameraParameters& lens) {
  constexpr double kLargest = 16384;
  for (const auto& [node, size] : {std::pair(width, &lens.width), std::pair(height, &lens.height)}) {
    const double value = file.number(node);
    if (!(value >= 1 && value <= kLargest && value == std::floor(value)))
      throw file.complaint(node, "not an image size", "pixels");
    *size = static_cast<int>(value);
  }
}

/// Whose keys are these, of a map with a number each. A key that ends with `?` may be missing: zero.
std::vector<double> numbers_of(const YamlFile& file, const YAML::Node& map, const std::string& before, Keys keys) {
  std::vector<double> values;
  for (const char* k : keys) {
    std::string key = before + k;
    const bool may_miss = key.back() == '?';
    if (may_miss) key.pop_back();
    values.push_back(may_miss ? file.optional(map, key.c_str()) : file.number(file.require(map, {key.c_str()})));
  }
  return values;
}

void set_lens(CameraModel model, const std::vector<double>& intrinsics, const std::vector<double>& distortion,
              CameraParameters& lens) {
  lens.model = model;
  std::copy(intrinsics.begin(), intrinsics.end(), lens.intrinsics.begin());
  std::copy(distortion.begin(), distortion.end(), lens.distortion.begin());
}

/// OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6]].
void set_radial(const YamlFile& file, const YAML::Node& node, const std::vector<double>& intrinsics,
                std::vector<double> distortion, CameraParameters& lens) {
  for (std::size_t i = 5; i < distortion.size(); ++i)
    if (distortion[i] != 0)
      throw file.complaint(node, "a lens with k4, k5, k6 (rational polynomial)",
                           "k1 k2 p1 p2 k3, or an equidistant lens; `epiline calibrate` finds one");
  distortion.resize(std::min<std::size_t>(distortion.size(), 5));
  set_lens(CameraModel::kPinholeRadialTangential, intrinsics, distortion, lens);
}

void check(const YamlFile& file, const YAML::Node& node, const CameraParameters& lens) {
  switch (fault_of(lens)) {
    case CameraFault::kNone:
      return;
    case CameraFault::kFocal:
      throw file.complaint(node, "a focal length that is not above zero", "pixels");
    case CameraFault::kCentre:
      throw file.complaint(node, "a principal point outside the image", "pixels");
    default:
      throw file.complaint(node, "numbers that are no lens", "those of a calibrated one");
  }
}

// --- CamOdoCal: a lens alone ---

void camodocal_lens(const YamlFile& file, CameraParameters& lens) {
  const YAML::Node model = file.require(file.root(), {"model_type"});
  const YAML::Node p = file.require(file.root(), {"projection_parameters"}),
                   d = file.find(file.root(), {"distortion_parameters"}),
                   mirror = file.find(file.root(), {"mirror_parameters"});
  set_size(file, file.require(file.root(), {"image_width"}), file.require(file.root(), {"image_height"}), lens);
  std::string name = file.text(model);
  for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  if (name == "KANNALA_BRANDT") {
    set_lens(CameraModel::kPinholeEquidistant, numbers_of(file, p, "", {"mu", "mv", "u0", "v0"}),
             numbers_of(file, p, "", {"k2", "k3", "k4", "k5"}), lens);
  } else if (name == "PINHOLE" || name == "PINHOLE_FULL") {
    set_radial(file, d, numbers_of(file, p, "", {"fx", "fy", "cx", "cy"}),
               numbers_of(file, d, "", {"k1", "k2", "p1", "p2", "k3?", "k4?", "k5?", "k6?"}), lens);
  } else if (name == "MEI") {
    const auto f = numbers_of(file, p, "", {"gamma1", "gamma2", "u0", "v0"});
    const auto k = numbers_of(file, d, "", {"k1", "k2", "p1", "p2"});
    const double xi = file.number(file.require(mirror, {"xi"}));
    if (!(xi >= 0)) throw file.complaint(mirror, "xi below zero", "zero or more");
    set_mei(xi, {k[0], k[1], k[2], k[3]}, {f[0], f[1], f[2], f[3]}, lens);
  } else {
    throw file.complaint(model, "the lens model " + name, "PINHOLE, KANNALA_BRANDT or MEI");
  }
  check(file, p, lens);
}

/// Formats without the camera's pose on the IMU take it from Kalibr's or ASL's keys beside their own.
void added_pose(const YamlFile& file, CameraCalibration& camera) {
  if (!file.find(file.root(), {"T_cam_imu", "T_BS", "T_imu_cam"}).IsDefined())
    throw file.complaint(YAML::Node(YAML::NodeType::Undefined), "the key `T_BS` is missing",
                         "the camera's pose on the IMU beside the lens: T_BS, T_imu_cam or T_cam_imu, a 4x4 matrix");
  read_pose(file, file.root(), camera);
  camera.time_offset_s = file.time_offset(file.root(), "timeshift_cam_imu");
}

CameraCalibration camodocal_camera(const YamlFile& file, const std::string&) {
  CameraCalibration camera;
  camodocal_lens(file, camera.parameters);
  added_pose(file, camera);
  return camera;
}

// --- VINS-Mono, VINS-Fusion: the pose, and the lens in CamOdoCal's layout in this file or one beside it ---

CameraCalibration vins_camera(const YamlFile& file, const std::string& name) {
  const YAML::Node& root = file.root();
  const std::string number = std::to_string(index_of(name));
  CameraCalibration camera;
  RigidMotion T;
  const YAML::Node rotation = file.find(root, {"extrinsicRotation"});
  if (number == "0" && rotation.IsDefined()) {
    const YAML::Node translation = file.require(root, {"extrinsicTranslation"});
    const std::vector<double> R = file.matrix(rotation, {9}, "a 3x3 matrix"),
                              p = file.matrix(translation, {3}, "x y z");
    T = rigid_motion(file, rotation, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data()),
                     Eigen::Map<const Vec3>(p.data()));
  } else {
    T = rigid_motion(file, file.require(root, {("body_T_cam" + number).c_str()}));
  }
  camera.R_BC = T.R;
  camera.p_BC = T.p;
  camera.time_offset_s = file.time_offset(root, "td");
  if (file.find(root, {"model_type"}).IsDefined()) {
    camodocal_lens(file, camera.parameters);
  } else {
    camodocal_lens(file.beside(file.require(root, {("cam" + number + "_calib").c_str()})), camera.parameters);
  }
  return camera;
}

ImuCalibration vins_imu(const YamlFile& file) {
  throw file.complaint(file.find(file.root(), {"acc_n", "gyr_n"}),
                       "acc_n and gyr_n are the noise of one reading, and enlarged",
                       "densities: gyroscope_noise_density and so on, as in Kalibr's imu.yaml");
}

// --- ORB-SLAM3: keys with dots; those of version 1.0, and those before ---

CameraCalibration orb_camera(const YamlFile& file, const std::string& name) {
  const YAML::Node& root = file.root();
  const bool second = index_of(name) == 1;
  const std::string before = second ? "Camera2." : file.find(root, {"Camera1.fx"}).IsDefined() ? "Camera1." : "Camera.";
  CameraCalibration camera;
  CameraParameters& lens = camera.parameters;
  if (index_of(name) > 1) throw file.complaint(root, "no " + name, "cam0 or cam1");
  set_size(file, file.require(root, {"Camera.width"}), file.require(root, {"Camera.height"}), lens);
  const YAML::Node type = file.require(root, {"Camera.type"});
  const std::vector<double> intrinsics = numbers_of(file, root, before, {"fx", "fy", "cx", "cy"});
  const std::string model = file.text(type);
  if (model == "KannalaBrandt8") {
    set_lens(CameraModel::kPinholeEquidistant, intrinsics, numbers_of(file, root, before, {"k1", "k2", "k3", "k4"}),
             lens);
  } else if (model == "PinHole") {
    set_radial(file, type, intrinsics, numbers_of(file, root, before, {"k1", "k2", "p1", "p2", "k3?"}), lens);
  } else if (model == "Rectified") {
    set_lens(CameraModel::kPinholeRadialTangential, intrinsics, {}, lens);
  } else {
    throw file.complaint(type, "the lens model " + model, "PinHole, KannalaBrandt8 or Rectified");
  }
  check(file, type, lens);
  RigidMotion T = rigid_motion(file, file.require(root, {"IMU.T_b_c1", "Tbc"}));
  if (second) {
    const RigidMotion T_12 = rigid_motion(file, file.require(root, {"Stereo.T_c1_c2", "Tlr"}));
    T = {T.R * T_12.R, T.R * T_12.p + T.p};
  }
  camera.R_BC = T.R;
  camera.p_BC = T.p;
  return camera;
}

ImuCalibration orb_imu(const YamlFile& file) {
  const auto at = [&](const char* key) { return file.positive(file.require(file.root(), {key})); };
  ImuCalibration imu;
  imu.noise = {at("IMU.NoiseGyro"), at("IMU.GyroWalk"), at("IMU.NoiseAcc"), at("IMU.AccWalk")};
  return imu;
}

// --- ROS CameraInfo, also as a topic prints it, and OpenCV's calibration program: a lens alone ---

CameraCalibration ros_camera(const YamlFile& file, const std::string&) {
  const YAML::Node& root = file.root();
  CameraCalibration camera;
  CameraParameters& lens = camera.parameters;
  set_size(file, file.require(root, {"image_width", "width"}), file.require(root, {"image_height", "height"}), lens);
  const YAML::Node matrix = file.require(root, {"camera_matrix", "K", "k"}),
                   model = file.find(root, {"distortion_model"}),
                   coefficients = file.require(root, {"distortion_coefficients", "D", "d"});
  const std::vector<double> K = file.matrix(matrix, {9}, "a 3x3 matrix");
  const std::vector<double> intrinsics = {K[0], K[4], K[2], K[5]};
  const std::string name = model.IsDefined() ? file.text(model) : "plumb_bob";
  if (name == "equidistant") {
    set_lens(CameraModel::kPinholeEquidistant, intrinsics, file.matrix(coefficients, {4}, "k1 k2 k3 k4"), lens);
  } else if (name == "plumb_bob" || name == "rational_polynomial") {
    set_radial(file, coefficients, intrinsics, file.matrix(coefficients, {4, 5, 8}, "k1 k2 p1 p2 [k3 [k4 k5 k6]]"),
               lens);
  } else {
    throw file.complaint(model, "the lens model " + name, "plumb_bob or equidistant");
  }
  check(file, matrix, lens);
  added_pose(file, camera);
  return camera;
}

// --- basalt: JSON, all below value0 ---

YAML::Node basalt_entry(const YamlFile& file, const char* key, const std::string& name) {
  const YAML::Node list = file.require(file.require(file.root(), {"value0"}), {key});
  if (!list.IsSequence() || index_of(name) >= list.size())
    throw file.complaint(list, "no " + name + " in " + key, "one entry for each camera");
  return list[index_of(name)];
}

void basalt_lens(const YamlFile& file, const YAML::Node& entry, CameraParameters& lens) {
  const YAML::Node type = file.require(entry, {"camera_type"}), numbers = file.require(entry, {"intrinsics"});
  const std::string model = file.text(type);
  const auto of = [&](Keys keys) { return numbers_of(file, numbers, "", keys); };
  const std::vector<double> intrinsics = of({"fx", "fy", "cx", "cy"});
  if (model == "ds") {
    set_lens(CameraModel::kDoubleSphere, intrinsics, of({"xi", "alpha"}), lens);
  } else if (model == "eucm") {
    set_lens(CameraModel::kUnified, intrinsics, of({"alpha", "beta"}), lens);
  } else if (model == "kb4") {
    set_lens(CameraModel::kPinholeEquidistant, intrinsics, of({"k1", "k2", "k3", "k4"}), lens);
  } else if (model == "pinhole") {
    set_lens(CameraModel::kPinholeRadialTangential, intrinsics, {}, lens);
  } else if (model == "pinhole-radtan8") {
    set_radial(file, type, intrinsics, of({"k1", "k2", "p1", "p2", "k3?", "k4?", "k5?", "k6?"}), lens);
  } else {
    throw file.complaint(type, "the lens model " + model, "ds, eucm, kb4, pinhole or pinhole-radtan8");
  }
  check(file, numbers, lens);
}

CameraCalibration basalt_camera(const YamlFile& file, const std::string& name) {
  CameraCalibration camera;
  const YAML::Node size = basalt_entry(file, "resolution", name), pose = basalt_entry(file, "T_imu_cam", name);
  if (!size.IsSequence() || size.size() != 2) throw file.complaint(size, "not an image size", "width, height");
  set_size(file, size[0], size[1], camera.parameters);
  basalt_lens(file, basalt_entry(file, "intrinsics", name), camera.parameters);
  const std::vector<double> q = numbers_of(file, pose, "q", {"w", "x", "y", "z"}),
                            p = numbers_of(file, pose, "p", {"x", "y", "z"});
  const RigidMotion T = rigid_motion(
      file, pose, Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix(), Vec3(p[0], p[1], p[2]));
  camera.R_BC = T.R;
  camera.p_BC = T.p;
  camera.time_offset_s = 1e-9 * file.optional(file.root()["value0"], "cam_time_offset_ns");
  return camera;
}

/// One number, or one for each axis: the largest.
double basalt_noise(const YamlFile& file, const char* key) {
  const YAML::Node node = file.require(file.root()["value0"], {key});
  if (!node.IsSequence()) return file.positive(node);
  const std::vector<double> values = file.numbers(node, {3}, "one for each axis");
  const double largest = *std::max_element(values.begin(), values.end());
  if (!(largest > 0)) throw file.complaint(node, "no noise", "a number above zero");
  return largest;
}

/// Readings that are right: (I + S) reading - bias. The bias, three numbers in front, is found in flight. Of the
/// accelerometer S is the lower triangle, column by column.
Mat3 basalt_scales(const YamlFile& file, const char* key, bool triangle) {
  Mat3 scales = Mat3::Identity();
  const YAML::Node node = file.find(file.root()["value0"], {key});
  if (!node.IsDefined()) return scales;
  const std::vector<double> values = file.numbers(node, {triangle ? 9u : 12u}, "3 of the bias, then the scales");
  std::size_t next = 3;
  for (int column = 0; column < 3; ++column)
    for (int row = triangle ? column : 0; row < 3; ++row) scales(row, column) += values[next++];
  return scales;
}

ImuCalibration basalt_imu(const YamlFile& file) {
  ImuCalibration imu;
  imu.noise = {basalt_noise(file, "gyro_noise_std"), basalt_noise(file, "gyro_bias_std"),
               basalt_noise(file, "accel_noise_std"), basalt_noise(file, "accel_bias_std")};
  imu.correction.accelerometer = basalt_scales(file, "calib_accel_bias", true);
  imu.correction.gyroscope = basalt_scales(file, "calib_gyro_bias", false);
  return imu;
}

// --- OpenVINS' main file, which names Kalibr's two ---

CameraCalibration openvins_camera(const YamlFile& file, const std::string& name) {
  return kalibr_camera(file.beside(file.require(file.root(), {"relative_config_imucam"})), name);
}
ImuCalibration openvins_imu(const YamlFile& file) {
  return kalibr_imu(file.beside(file.require(file.root(), {"relative_config_imu"})));
}

const CalibrationFormat kFormats[] = {
    {"basalt", {"value0"}, basalt_camera, basalt_imu},
    {"OpenVINS", {"relative_config_imucam", "relative_config_imu"}, openvins_camera, openvins_imu},
    {"VINS", {"body_T_cam0", "extrinsicRotation", "cam0_calib", "estimate_extrinsic"}, vins_camera, vins_imu},
    {"CamOdoCal", {"model_type"}, camodocal_camera, nullptr, false},
    {"ORB-SLAM3", {"Camera.type"}, orb_camera, orb_imu},
    {"ROS (CameraInfo)", {"camera_matrix", "K", "k"}, ros_camera, nullptr, false},
};

}  // namespace

const CalibrationFormat* foreign_format(const YamlFile& file) {
  for (const CalibrationFormat& format : kFormats)
    if (file.find(file.root(), format.marks).IsDefined()) return &format;
  return nullptr;
}

}  // namespace epiline
