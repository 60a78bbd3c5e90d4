#include "pipeline/config/calibration.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/config/calibration_formats.h"

namespace epiline {

namespace {

struct Projection {
  bool is_omni = false;
  double xi = 0;  ///< of omni
};

Projection read_projection(const YamlFile& file, const YAML::Node& map, CameraParameters& camera) {
  const YAML::Node model = file.require(map, {"camera_model"});
  const YAML::Node intrinsics = file.require(map, {"intrinsics"});
  const std::string& name = model.Scalar();
  Projection projection;
  std::vector<double> numbers;
  const auto take = [&](std::size_t first, const char* what) {
    numbers = file.numbers(intrinsics, {first + 4}, what);
    std::vector<double> taken(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(first));
    numbers.erase(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(first));
    return taken;
  };
  const auto share = [&](double alpha, const char* what) {
    if (!(alpha >= 0 && alpha <= 1)) throw file.complaint(intrinsics, "alpha outside 0 to 1", what);
  };
  if (name == "pinhole") {
    take(0, "fu fv cu cv");
  } else if (name == "double-sphere" || name == "ds") {
    const auto first = take(2, "xi alpha fu fv cu cv");
    camera.model = CameraModel::kDoubleSphere;
    camera.distortion = {first[0], first[1]};
    share(first[1], "xi alpha fu fv cu cv");
  } else if (name == "eucm") {
    const auto first = take(2, "alpha beta fu fv cu cv");
    camera.model = CameraModel::kUnified;
    camera.distortion = {first[0], first[1]};
    share(first[0], "alpha beta fu fv cu cv");
    if (!(first[1] > 0)) throw file.complaint(intrinsics, "beta not above zero", "alpha beta fu fv cu cv");
  } else if (name == "omni") {
    projection = {true, take(1, "xi fu fv cu cv")[0]};
    camera.model = CameraModel::kUnified;
    if (!(projection.xi >= 0)) throw file.complaint(intrinsics, "xi below zero", "xi fu fv cu cv");
  } else {
    throw file.complaint(model, "unknown camera model \"" + name + "\"", "pinhole, double-sphere (ds), eucm or omni");
  }
  std::copy(numbers.begin(), numbers.end(), camera.intrinsics.begin());
  if (!(numbers[0] > 0 && numbers[1] > 0))
    throw file.complaint(intrinsics, "a focal length that is not above zero", "pixels");
  return projection;
}

void read_distortion(const YamlFile& file, const YAML::Node& map, const Projection& projection,
                     CameraParameters& camera) {
  const YAML::Node model = file.require(map, {"distortion_model"});
  const std::string& name = model.Scalar();
  const bool unified = camera.model == CameraModel::kUnified;
  std::vector<double> numbers(4);
  const auto coefficients = [&](std::initializer_list<std::size_t> counts, const char* what) {
    numbers = file.numbers(file.require(map, {"distortion_coefficients", "distortion_coeffs"}), counts, what);
  };
  if (camera.model == CameraModel::kDoubleSphere && name != "none")
    throw file.complaint(model, "distortion model \"" + name + "\" with a double sphere", "none");
  if (name == "radial-tangential" || name == "radtan") {
    if (unified) {
      coefficients({4}, "k1 k2 p1 p2");
    } else {
      coefficients({4, 5}, "k1 k2 p1 p2 [k3]");
    }
  } else if (name == "equidistant" && !unified) {
    camera.model = CameraModel::kPinholeEquidistant;
    coefficients({4}, "k1 k2 k3 k4");
  } else if (name != "none") {
    throw file.complaint(model, "unknown distortion model \"" + name + "\"",
                         unified ? "radial-tangential or none" : "radial-tangential, equidistant or none");
  }
  if (projection.is_omni) {
    set_mei(projection.xi, {numbers[0], numbers[1], numbers[2], numbers[3]}, camera.intrinsics, camera);
  } else if (camera.model != CameraModel::kDoubleSphere) {
    std::copy(numbers.begin(), numbers.end(), camera.distortion.begin() + (unified ? 2 : 0));
  }
}

Mat3 matrix3(const YamlFile& file, const YAML::Node& map, const char* key, const Mat3& otherwise) {
  const YAML::Node node = file.find(map, {key});
  if (!node.IsDefined()) return otherwise;
  const std::vector<double> m = file.matrix(node, {9}, "a 3x3 matrix, row by row");
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}

/// Kalibr's M, A and C_gyro_i below `accelerometers` and `gyroscopes`, or the same as OpenVINS names them.
ImuCorrection read_correction(const YamlFile& file, const YAML::Node& map) {
  const YAML::Node a = file.find(map, {"accelerometers"}), g = file.find(map, {"gyroscopes"});
  const Mat3 I = Mat3::Identity(), none = Mat3::Zero();
  for (const char* place : {"rx_i", "ry_i", "rz_i"}) {
    const YAML::Node node = file.find(a, {place});
    if (!node.IsDefined()) continue;
    for (const double x : file.numbers(node, {3}, "a place in m"))
      if (x != 0)
        throw file.complaint(node, "the key `" + std::string(place) + "`: accelerometers apart from each other",
                             "Kalibr's model scale-misalignment, which has one place for all three");
  }
  if (a.IsDefined() || g.IsDefined()) {
    const Mat3 C = matrix3(file, g, "C_gyro_i", I);
    return correction_of(file, matrix3(file, a, "M", I), matrix3(file, g, "M", I), C, matrix3(file, g, "A", none) * C);
  }
  ImuCorrection correction = correction_of(file, matrix3(file, map, "Ta", I), matrix3(file, map, "Tw", I),
                                           matrix3(file, map, "R_IMUtoGYRO", I), matrix3(file, map, "Tg", none));
  correction.accelerometer = matrix3(file, map, "R_IMUtoACC", I).transpose() * correction.accelerometer;
  return correction;
}

/// Calls `read` for the file's format. An error says which format that is.
template <class T, class Read>
Result<T> read_by_format(const std::filesystem::path& path, const Read& read) {
  try {
    const YamlFile file(path);
    const CalibrationFormat* format = foreign_format(file);
    try {
      return read(file, format);
    } catch (Error& e) {
      if (format != nullptr) e.found = std::string("a file of ") + format->name + ": " + e.found;
      throw;
    }
  } catch (const Error& e) {
    return e;
  }
}

}  // namespace

bool ImuCorrection::is_none() const {
  return accelerometer == Mat3::Identity() && gyroscope == Mat3::Identity() && gyroscope_by_force == Mat3::Zero();
}

void ImuCorrection::apply(ImuSample& s) const noexcept {
  const Vec3 f = accelerometer * vec3(s.specific_force_m_s2),
             w = gyroscope * vec3(s.angular_velocity_rad_s) - gyroscope_by_force * f;
  s.specific_force_m_s2 = {f.x(), f.y(), f.z()};
  s.angular_velocity_rad_s = {w.x(), w.y(), w.z()};
}

ImuCorrection correction_of(const YamlFile& file, const Mat3& accelerometer_M, const Mat3& gyroscope_M, const Mat3& C,
                            const Mat3& A) {
  constexpr double kLeast = 0.1;  // of a determinant: scales are near one
  if (!(std::abs(accelerometer_M.determinant()) > kLeast && std::abs((gyroscope_M * C).determinant()) > kLeast))
    throw file.complaint(YAML::Node(YAML::NodeType::Undefined), "a matrix of the IMU's scales without an inverse",
                         "matrices near the identity, or turns");
  const Mat3 gyroscope = (gyroscope_M * C).inverse();
  return {accelerometer_M.inverse(), gyroscope, gyroscope * A};
}

void read_pose(const YamlFile& file, const YAML::Node& map, CameraCalibration& camera) {
  const YAML::Node inverse = file.find(map, {"T_cam_imu"});
  const RigidMotion T = rigid_motion(file, inverse.IsDefined() ? inverse : file.require(map, {"T_BS", "T_imu_cam"}));
  camera.R_BC = inverse.IsDefined() ? Mat3(T.R.transpose()) : T.R;
  camera.p_BC = inverse.IsDefined() ? Vec3(-(T.R.transpose() * T.p)) : T.p;
}

// Mei's plane lies 1 + xi times as near as that of kUnified: (x, y) / (z + xi |p|).
void set_mei(double xi, const std::array<double, 4>& distortion, const std::array<double, 4>& intrinsics,
             CameraParameters& lens) {
  const double nearer = 1 / (1 + xi);
  const auto& [k1, k2, p1, p2] = distortion;
  lens.model = CameraModel::kUnified;
  lens.distortion = {xi * nearer, 1,          k1 * nearer * nearer, k2 * nearer * nearer * nearer * nearer,
                     p1 * nearer, p2 * nearer};
  lens.intrinsics = {intrinsics[0] * nearer, intrinsics[1] * nearer, intrinsics[2], intrinsics[3]};
}

CameraCalibration kalibr_camera(const YamlFile& file, const std::string& name) {
  const YAML::Node chain = file.root()[name];
  const YAML::Node map = chain.IsDefined() && chain.IsMap() ? chain : file.root();
  CameraCalibration camera;
  read_pose(file, map, camera);
  const YAML::Node resolution = file.require(map, {"resolution"});
  const std::vector<double> size = file.numbers(resolution, {2}, "width height");
  constexpr double kLargest = 16384;
  for (const double s : size) {
    if (!(s >= 1 && s <= kLargest && s == std::floor(s)))
      throw file.complaint(resolution, "not an image size", "width height in pixels");
  }
  camera.parameters.width = static_cast<int>(size[0]);
  camera.parameters.height = static_cast<int>(size[1]);
  const Projection projection = read_projection(file, map, camera.parameters);
  read_distortion(file, map, projection, camera.parameters);
  camera.time_offset_s = file.time_offset(map, "timeshift_cam_imu");
  const YAML::Node line_delay = file.find(map, {"line_delay_nanoseconds"});
  if (line_delay.IsDefined()) camera.parameters.readout_s = 1e-9 * file.number(line_delay) * (size[1] - 1);
  return camera;
}

ImuCalibration kalibr_imu(const YamlFile& file) {
  const YAML::Node chain = file.root()["imu0"];  // what Kalibr writes; what it reads has the keys outside
  const YAML::Node map = chain.IsDefined() && chain.IsMap() ? chain : file.root();
  const YAML::Node T_BS = file.find(map, {"T_BS", "T_i_b"});
  if (T_BS.IsDefined()) {
    const RigidMotion T = rigid_motion(file, T_BS);
    constexpr double kSame = 1e-6;
    if (!T.R.isIdentity(kSame) || T.p.norm() > kSame) {
      throw file.complaint(T_BS, "the IMU is not the body frame",
                           "the identity, with the camera's T_BS relative to the IMU");
    }
  }
  ImuCalibration imu;
  imu.noise.gyroscope_density = file.positive(file.require(map, {"gyroscope_noise_density"}));
  imu.noise.gyroscope_random_walk = file.positive(file.require(map, {"gyroscope_random_walk"}));
  imu.noise.accelerometer_density = file.positive(file.require(map, {"accelerometer_noise_density"}));
  imu.noise.accelerometer_random_walk = file.positive(file.require(map, {"accelerometer_random_walk"}));
  const YAML::Node gyroscope = file.find(map, {"gyroscope_saturation"}),
                   accelerometer = file.find(map, {"accelerometer_saturation"});
  if (gyroscope.IsDefined()) imu.saturation_gyroscope_rad_s = file.positive(gyroscope);
  if (accelerometer.IsDefined()) imu.saturation_accelerometer_m_s2 = file.positive(accelerometer);
  imu.correction = read_correction(file, map);
  return imu;
}

Result<CameraCalibration> read_camera_calibration(const std::filesystem::path& path, const std::string& name) {
  return read_by_format<CameraCalibration>(path, [&](const YamlFile& file, const CalibrationFormat* format) {
    return format != nullptr ? format->camera(file, name) : kalibr_camera(file, name);
  });
}

bool is_chain_with(const std::filesystem::path& path, const std::string& name) {
  try {
    const YamlFile file(path);
    if (const CalibrationFormat* format = foreign_format(file)) {
      if (format->has_several_cameras) format->camera(file, name);
      return format->has_several_cameras;
    }
    const YAML::Node camera = file.root()[name];
    return camera.IsDefined() && camera.IsMap();
  } catch (const Error&) {
    return false;  // its reader will say what is wrong
  }
}

void set_shutter(const CameraConfig& section, CameraParameters& camera) {
  const bool is_rolling = section.shutter == 1;  // kShutterNames
  if (is_rolling) camera.readout_s = 1e-3 * section.readout_ms;
}

void set_calibration(const CameraCalibration& camera, EstimatorConfig& estimator) {
  estimator.extrinsics = {camera.R_BC, camera.p_BC, Camera(camera.parameters).focal_px(), camera.time_offset_s,
                          camera.parameters.readout_s};
}

void set_calibration(const ImuCalibration& imu, EstimatorConfig& estimator) {
  estimator.imu = imu.noise;
  if (imu.saturation_gyroscope_rad_s) estimator.saturation_gyroscope_rad_s = *imu.saturation_gyroscope_rad_s;
  if (imu.saturation_accelerometer_m_s2) estimator.saturation_accelerometer_m_s2 = *imu.saturation_accelerometer_m_s2;
}

Result<ImuCalibration> read_imu_calibration(const std::filesystem::path& path) {
  return read_by_format<ImuCalibration>(path, [&](const YamlFile& file, const CalibrationFormat* format) {
    if (format == nullptr) return kalibr_imu(file);
    if (format->imu == nullptr)
      throw file.complaint(file.root(), "it holds no IMU", "Kalibr's imu.yaml, or one of another format");
    return format->imu(file);
  });
}

bool holds_no_calibration(const std::filesystem::path& path) {
  try {
    const YamlFile file(path);
    const auto calibrated = {"T_BS", "camera_model", "intrinsics", "gyroscope_noise_density",
                             "accelerometer_noise_density"};
    return file.find(file.root(), {"sensor_type"}).IsDefined() && !file.find(file.root(), calibrated).IsDefined();
  } catch (const Error&) {
    return false;  // its reader will say what is wrong
  }
}

}  // namespace epiline
