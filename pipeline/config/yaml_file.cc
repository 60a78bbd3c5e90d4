#include "pipeline/config/yaml_file.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/geometry/so3.h"
#include "pipeline/text/table.h"

namespace epiline {

YamlFile::YamlFile(const std::filesystem::path& path) : path_(path) {
  auto text = read_text(path);
  if (!text) throw Error(text.error());
  if (text->rfind("%YAML:", 0) == 0) text->replace(0, 1, "#");  // OpenCV's header is not YAML
  try {
    root_ = YAML::Load(*text);
  } catch (const YAML::ParserException& e) {
    throw Error{ErrorKind::kUsage, path.string(), e.mark.line + 1, "not YAML (" + e.msg + ")", "a calibration file"};
  }
  if (!root_.IsMap()) throw Error{ErrorKind::kUsage, path.string(), 0, "holds no keys", "a calibration file"};
}

Error YamlFile::complaint(const YAML::Node& node, std::string found, std::string expected) const {
  const int line = node.IsDefined() ? node.Mark().line + 1 : 0;
  return {ErrorKind::kUsage, path_.string(), line, std::move(found), std::move(expected)};
}

YAML::Node YamlFile::find(const YAML::Node& map, std::initializer_list<const char*> keys) const {
  for (const char* key : keys) {
    const YAML::Node node = map.IsDefined() && map.IsMap() ? map[key] : YAML::Node(YAML::NodeType::Undefined);
    if (node.IsDefined() && !node.IsNull()) return node;
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node YamlFile::require(const YAML::Node& map, std::initializer_list<const char*> keys) const {
  const YAML::Node node = find(map, keys);
  if (!node.IsDefined()) throw complaint(node, "the key `" + std::string(*keys.begin()) + "` is missing", "this key");
  return node;
}

std::string YamlFile::text(const YAML::Node& node) const {
  if (!node.IsScalar()) throw complaint(node, "not a text", "a text");
  return node.Scalar();
}

double YamlFile::number(const YAML::Node& node) const {
  double value = 0;
  if (!node.IsScalar() || !parse_number(node.Scalar(), value) || !std::isfinite(value)) {
    throw complaint(node, node.IsScalar() ? "\"" + node.Scalar() + "\"" : "not a number", "a finite number");
  }
  return value;
}

double YamlFile::positive(const YAML::Node& node) const {
  const double value = number(node);
  if (!(value > 0)) throw complaint(node, node.Scalar(), "a number above zero");
  return value;
}

double YamlFile::optional(const YAML::Node& map, const char* key) const {
  const YAML::Node node = find(map, {key});
  return node.IsDefined() ? number(node) : 0;
}

double YamlFile::time_offset(const YAML::Node& map, const char* key) const {
  constexpr double kMost = 1;  // as of camera.time_offset_s
  const double value = optional(map, key);
  if (std::abs(value) <= kMost) return value;
  throw complaint(find(map, {key}), std::string(key) + " of more than a second",
                  "seconds from -1 to 1: divide milliseconds by 1e3, nanoseconds by 1e9");
}

std::vector<double> YamlFile::numbers(const YAML::Node& node, int depth) const {
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

std::vector<double> YamlFile::numbers(const YAML::Node& node, std::initializer_list<std::size_t> counts,
                                      const std::string& what) const {
  const std::vector<double> values = numbers(node);
  if (std::find(counts.begin(), counts.end(), values.size()) != counts.end()) return values;
  std::string list;
  for (const std::size_t c : counts) list += (list.empty() ? "" : " or ") + std::to_string(c);
  throw complaint(node, std::to_string(values.size()) + (values.size() == 1 ? " number" : " numbers"),
                  list + ": " + what);
}

std::vector<double> YamlFile::matrix(const YAML::Node& node, std::initializer_list<std::size_t> counts,
                                     const std::string& what) const {
  return numbers(node.IsMap() ? require(node, {"data"}) : node, counts, what);
}

RigidMotion rigid_motion(const YamlFile& file, const YAML::Node& node, const Mat3& R, const Vec3& p) {
  constexpr double kRounding = 1e-3;  // published matrices are printed with a few digits
  constexpr double kExact = 1e-14;    // those of ours have all: what was written is read, bit by bit
  const double error = (R.transpose() * R - Mat3::Identity()).cwiseAbs().maxCoeff();
  if (error > kRounding || R.determinant() < 0)
    throw file.complaint(node, "not a rigid motion", "a rotation matrix and a translation, with the last row 0 0 0 1");
  return {error > kExact ? so3_normalised(R) : R, p};
}

RigidMotion rigid_motion(const YamlFile& file, const YAML::Node& node) {
  const YAML::Node data = node.IsMap() ? file.require(node, {"data"}) : node;
  const std::vector<double> m = file.numbers(data, {16}, "a 4x4 matrix, row by row");
  Mat3 R;
  Vec3 p;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R(r, c) = m[static_cast<std::size_t>(4 * r + c)];
    p[r] = m[static_cast<std::size_t>(4 * r + 3)];
  }
  const bool last_row = m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
  return rigid_motion(file, data, last_row ? R : Mat3::Zero(), p);
}

}  // namespace epiline
