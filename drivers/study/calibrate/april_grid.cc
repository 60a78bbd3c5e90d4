#include "drivers/study/calibrate/april_grid.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>

#include "pipeline/text/table.h"

namespace epiline {

namespace {

/// One number of a board's description, and what is wrong with it. Thrown in this file only.
double number(const YAML::Node& root, const std::filesystem::path& path, const char* key, double most) {
  const YAML::Node node = root[key];
  const int line = node.IsDefined() ? node.Mark().line + 1 : 0;
  double value = 0;
  if (!node.IsDefined() || !node.IsScalar() || !parse_number(node.Scalar(), value)) {
    throw Error{ErrorKind::kUsage, path.string(), line, fmt::format("no number `{}`", key),
                "target_type: 'aprilgrid' with tagCols, tagRows, tagSize (m) and tagSpacing"};
  }
  if (!(value > 0 && value <= most)) {
    throw Error{ErrorKind::kUsage, path.string(), line, fmt::format("{} = {}", key, node.Scalar()),
                fmt::format("above 0, at most {}", most)};
  }
  return value;
}

AprilGrid grid_of(const YAML::Node& root, const std::filesystem::path& path) {
  if (!root.IsMap() || !root["target_type"].IsDefined() || !root["target_type"].IsScalar() ||
      root["target_type"].Scalar() != "aprilgrid") {
    throw Error{ErrorKind::kUsage, path.string(), 0, "not a board of AprilTags", "target_type: 'aprilgrid'"};
  }
  constexpr double kMostTags = 100, kLargest_m = 10, kWidestGap = 10;
  AprilGrid grid;
  const double columns = number(root, path, "tagCols", kMostTags), rows = number(root, path, "tagRows", kMostTags);
  grid.columns = static_cast<int>(columns);
  grid.rows = static_cast<int>(rows);
  if (grid.columns != columns || grid.rows != rows || grid.tags() > kTagsOfFamily) {
    throw Error{ErrorKind::kUsage, path.string(), root["tagCols"].Mark().line + 1,
                fmt::format("{} x {} tags", columns, rows),
                fmt::format("whole numbers, at most {} tags", kTagsOfFamily)};
  }
  grid.tag_m = number(root, path, "tagSize", kLargest_m);
  grid.spacing = number(root, path, "tagSpacing", kWidestGap);
  return grid;
}

}  // namespace

Target AprilGrid::target() const {
  Target target;
  for (int tag = 0; tag < tags(); ++tag) {
    const int column = tag % columns, row = tag / columns;
    const double x = step_m() * column, y = step_m() * row;
    const auto id = static_cast<std::uint32_t>(4 * tag);
    target[id] = {x, y, 0};
    target[id + 1] = {x + tag_m, y, 0};
    target[id + 2] = {x + tag_m, y + tag_m, 0};
    target[id + 3] = {x, y + tag_m, 0};
  }
  return target;
}

Result<AprilGrid> read_april_grid(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text) return text.error();
  try {
    return grid_of(YAML::Load(*text), path);
  } catch (const YAML::ParserException& e) {
    return Error{ErrorKind::kUsage, path.string(), e.mark.line + 1, "not YAML (" + e.msg + ")",
                 "a board's description"};
  } catch (const Error& e) {
    return e;
  }
}

std::string april_grid_yaml(const AprilGrid& grid) {
  return fmt::format(
      "target_type: 'aprilgrid'\ntagCols: {}\ntagRows: {}\ntagSize: {}      # m, the black square; measure it\n"
      "tagSpacing: {}   # of tagSize\n",
      grid.columns, grid.rows, grid.tag_m, grid.spacing);
}

}  // namespace epiline
