#include "pipeline/config/calibration.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <vector>

#include "estimator/geometry/so3.h"
#include "pipeline/text/table.h"

namespace epiline {

namespace {

/// A YAML file and the complaints about it. Complaints are thrown inside this file only; its two functions turn them
/// into values.
class YamlFile {
 public:
  explicit YamlFile(const std::filesystem::path& path) : name_(path.string()) {
    auto text = read_text(path);
    if (!text) throw Error(text.error());
    if (text->rfind("%YAML:", 0) == 0) text->replace(0, 1, "#");  // OpenCV's header is not YAML
    try {
      root_ = YAML::Load(*text);
    } catch (const YAML::ParserException& e) {
      throw Error{ErrorKind::kUsage, name_, e.mark.line + 1, "not YAML (" + e.msg + ")", "a calibration file"};
    }
    if (!root_.IsMap()) throw Error{ErrorKind::kUsage, name_, 0, "holds no keys", "a calibration file"};
  }

  const YAML::Node& root() const { return root_; }

  Error complaint(const YAML::Node& node, std::string found, std::string expected) const {
    const int line = node.IsDefined() ? node.Mark().line + 1 : 0;
    return {ErrorKind::kUsage, name_, line, std::move(found), std::move(expected)};
  }

  /// The first of the keys that is there.
  YAML::Node find(const YAML::Node& map, std::initializer_list<const char*> keys) const {
    for (const char* key : keys) {
      const YAML::Node node = map[key];
      if (node.IsDefined() && !node.IsNull()) return node;
    }
    return YAML::Node(YAML::NodeType::Undefined);
  }
  YAML::Node require(const YAML::Node& map, std::initializer_list<const char*> keys) const {
    const YAML::Node node = find(map, keys);
    if (!node.IsDefined()) throw complaint(node, "the key `" + std::string(*keys.begin()) + "` is missing", "this key");
    return node;
  }

  double number(const YAML::Node& node) const {
    double value = 0;
    if (!node.IsScalar() || !parse_number(node.Scalar(), value) || !std::isfinite(value)) {
      throw complaint(node, node.IsScalar() ? "\"" + node.Scalar() + "\"" : "not a number", "a finite number");
    }
    return value;
  }
  double positive(const YAML::Node& node) const {
    const double value = number(node);
    if (!(value > 0)) throw complaint(node, node.Scalar(), "a number above zero");
    return value;
  }

  /// All numbers of a list, or of a list of lists. An anchor may make a list its own element, or a few lines a list of
  /// millions: neither depth nor length is more than a calibration has.
  std::vector<double> numbers(const YAML::Node& node, int depth = 2) const {
    constexpr std::size_t kMost = 64;
    if (!node.IsSequence() || depth == 0) throw complaint(node, "not a list", "a list of numbers");
    std::vector<double> values;
    for (const YAML::Node& item : node) {
      if (item.IsSequence()) {
        const std::vector<double> inner = numbers(item, depth - 1);
        values.insert(values.end(), inner.begin(), inner.end());
      } else {
        values.push_back(number(item));
      }
      if (values.size() > kMost) throw complaint(node, "an endless list", "a list of numbers");
    }
    return values;
  }
  std::vector<double> numbers(const YAML::Node& node, std::initializer_list<std::size_t> counts,
                              const std::string& what) const {
    const std::vector<double> values = numbers(node);
    if (std::find(counts.begin(), counts.end(), values.size()) != counts.end()) return values;
    std::string list;
    for (const std::size_t c : counts) list += (list.empty() ? "" : " or ") + std::to_string(c);
    throw complaint(node, std::to_string(values.size()) + (values.size() == 1 ? " number" : " numbers"),
                    list + ": " + what);
  }

 private:
  std::string name_;
  YAML::Node root_;
};

struct RigidMotion {
  Mat3 R = Mat3::Identity();
  Vec3 p = Vec3::Zero();
};

RigidMotion rigid_motion(const YamlFile& file, const YAML::Node& node) {
  const YAML::Node data = node.IsMap() ? file.require(node, {"data"}) : node;
  const std::vector<double> m = file.numbers(data, {16}, "a 4x4 matrix, row by row");
  RigidMotion T;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) T.R(r, c) = m[static_cast<std::size_t>(4 * r + c)];
    T.p[r] = m[static_cast<std::size_t>(4 * r + 3)];
  }
  constexpr double kRounding = 1e-3;  // published matrices are printed with a few digits
  constexpr double kExact = 1e-14;    // those of ours have all: what was written is read, bit by bit
  const bool last_row = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
  const double error = (T.R.transpose() * T.R - Mat3::Identity()).cwiseAbs().maxCoeff();
  if (!last_row || error > kRounding || T.R.determinant() < 0) {
    throw file.complaint(data, "not a rigid motion", "a rotation matrix and a translation, with the last row 0 0 0 1");
  }
  if (error > kExact) T.R = so3_normalised(T.R);
  return T;
}

void read_projection(const YamlFile& file, const YAML::Node& map, CameraParameters& camera) {
  const YAML::Node model = file.require(map, {"camera_model"});
  const YAML::Node intrinsics = file.require(map, {"intrinsics"});
  const std::string& name = model.Scalar();
  std::vector<double> numbers;
  if (name == "pinhole") {
    numbers = file.numbers(intrinsics, {4}, "fu fv cu cv");
  } else if (name == "double-sphere" || name == "ds") {
    camera.model = CameraModel::kDoubleSphere;
    numbers = file.numbers(intrinsics, {6}, "xi alpha fu fv cu cv");
    camera.distortion = {numbers[0], numbers[1]};
    if (!(numbers[1] >= 0 && numbers[1] <= 1))
      throw file.complaint(intrinsics, "alpha outside 0 to 1", "xi alpha fu fv cu cv");
    numbers.erase(numbers.begin(), numbers.begin() + 2);
  } else {
    throw file.complaint(model, "unknown camera model \"" + name + "\"", "pinhole or double-sphere");
  }
  std::copy(numbers.begin(), numbers.end(), camera.intrinsics.begin());
  if (!(numbers[0] > 0 && numbers[1] > 0))
    throw file.complaint(intrinsics, "a focal length that is not above zero", "pixels");
}

void read_distortion(const YamlFile& file, const YAML::Node& map, CameraParameters& camera) {
  const YAML::Node model = file.require(map, {"distortion_model"});
  const std::string& name = model.Scalar();
  const bool sphere = camera.model == CameraModel::kDoubleSphere;
  if (name == "none") return;
  std::vector<double> numbers;
  const auto coefficients = [&](std::initializer_list<std::size_t> counts, const char* what) {
    numbers = file.numbers(file.require(map, {"distortion_coefficients", "distortion_coeffs"}), counts, what);
  };
  if (sphere) {
    throw file.complaint(model, "distortion model \"" + name + "\" with a double sphere", "none");
  } else if (name == "radial-tangential" || name == "radtan") {
    coefficients({4, 5}, "k1 k2 p1 p2 [k3]");
  } else if (name == "equidistant") {
    camera.model = CameraModel::kPinholeEquidistant;
    coefficients({4}, "k1 k2 k3 k4");
  } else {
    throw file.complaint(model, "unknown distortion model \"" + name + "\"", "radial-tangential, equidistant or none");
  }
  std::copy(numbers.begin(), numbers.end(), camera.distortion.begin());
}

CameraCalibration camera_from(const YamlFile& file, const std::string& name) {
  const YAML::Node chain = file.root()[name];
  const YAML::Node map = chain.IsDefined() && chain.IsMap() ? chain : file.root();
  CameraCalibration camera;
  const YAML::Node inverse = file.find(map, {"T_cam_imu"});
  const RigidMotion T = rigid_motion(file, inverse.IsDefined() ? inverse : file.require(map, {"T_BS", "T_imu_cam"}));
  camera.R_BC = inverse.IsDefined() ? Mat3(T.R.transpose()) : T.R;
  camera.p_BC = inverse.IsDefined() ? Vec3(-(T.R.transpose() * T.p)) : T.p;
  const YAML::Node resolution = file.require(map, {"resolution"});
  const std::vector<double> size = file.numbers(resolution, {2}, "width height");
  constexpr double kLargest = 16384;
  for (const double s : size) {
    if (!(s >= 1 && s <= kLargest && s == std::floor(s)))
      throw file.complaint(resolution, "not an image size", "width height in pixels");
  }
  camera.parameters.width = static_cast<int>(size[0]);
  camera.parameters.height = static_cast<int>(size[1]);
  read_projection(file, map, camera.parameters);
  read_distortion(file, map, camera.parameters);
  const YAML::Node shift = file.find(map, {"timeshift_cam_imu"});
  if (shift.IsDefined()) camera.time_offset_s = file.number(shift);
  const YAML::Node line_delay = file.find(map, {"line_delay_nanoseconds"});
  if (line_delay.IsDefined()) camera.parameters.readout_s = 1e-9 * file.number(line_delay) * (size[1] - 1);
  return camera;
}

ImuCalibration imu_from(const YamlFile& file) {
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
  return imu;
}

}  // namespace

Result<CameraCalibration> read_camera_calibration(const std::filesystem::path& path, const std::string& name) {
  try {
    return camera_from(YamlFile(path), name);
  } catch (const Error& e) {
    return e;
  }
}

bool is_chain_with(const std::filesystem::path& path, const std::string& name) {
  try {
    const YamlFile file(path);
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

Result<ImuCalibration> read_imu_calibration(const std::filesystem::path& path) {
  try {
    return imu_from(YamlFile(path));
  } catch (const Error& e) {
    return e;
  }
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
