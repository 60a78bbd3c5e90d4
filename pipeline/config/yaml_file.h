#pragma once
// A calibration file in YAML (or JSON), and complaints about it. They are thrown as Error by these functions, and
// turned into values where a file is opened (calibration.cc).
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <string>
#include <vector>

#include "estimator/geometry/types.h"
#include "platform/error/result.h"

namespace epiline {

class YamlFile {
 public:
  explicit YamlFile(const std::filesystem::path& path);

  const YAML::Node& root() const { return root_; }
  /// A file that this one names, which lies beside it unless its path is absolute.
  YamlFile beside(const YAML::Node& name) const { return YamlFile(path_.parent_path() / text(name)); }

  Error complaint(const YAML::Node& node, std::string found, std::string expected) const;

  /// The first of the keys that is there.
  YAML::Node find(const YAML::Node& map, std::initializer_list<const char*> keys) const;
  YAML::Node require(const YAML::Node& map, std::initializer_list<const char*> keys) const;

  std::string text(const YAML::Node& node) const;
  double number(const YAML::Node& node) const;
  double positive(const YAML::Node& node) const;
  /// That of the key, or zero.
  double optional(const YAML::Node& map, const char* key) const;
  /// Time offset in seconds, 0 if the key is missing; refuses what can only be another unit.
  double time_offset(const YAML::Node& map, const char* key) const;

  /// All numbers of a list, or of a list of lists. An anchor may make a list its own element, or a few lines a list of
  /// millions: neither depth nor length is more than a calibration has.
  std::vector<double> numbers(const YAML::Node& node, int depth = 2) const;
  std::vector<double> numbers(const YAML::Node& node, std::initializer_list<std::size_t> counts,
                              const std::string& what) const;
  /// Of a matrix: a list, or OpenCV's with the key `data`.
  std::vector<double> matrix(const YAML::Node& node, std::initializer_list<std::size_t> counts,
                             const std::string& what) const;

 private:
  std::filesystem::path path_;
  YAML::Node root_;
};

struct RigidMotion {
  Mat3 R = Mat3::Identity();
  Vec3 p = Vec3::Zero();
};
/// Of a 4x4 matrix.
RigidMotion rigid_motion(const YamlFile& file, const YAML::Node& node);
/// The same from its parts.
RigidMotion rigid_motion(const YamlFile& file, const YAML::Node& node, const Mat3& R, const Vec3& p);

}  // namespace epiline
