#include "drivers/study/calibrate/board.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cmath>

#include "pipeline/text/table.h"

namespace epiline {

namespace {

constexpr const char* kGridKeys = "target_type: 'aprilgrid' with tagCols, tagRows, tagSize (m) and tagSpacing";
constexpr const char* kCharucoKeys =
    "target_type: 'charuco' with dictionary, squaresX, squaresY, squareSize (m) and markerSize (m)";
constexpr double kMostSquares = 100, kLargest_m = 10, kWidestGap = 10;

/// The description of one board, and what is wrong with it. Throws Error, in this file only.
struct Description {
  const YAML::Node& root;
  const std::filesystem::path& path;
  const char* keys;  ///< that it should have

  [[noreturn]] void complain(const char* key, std::string found, std::string wanted) const {
    const YAML::Node node = root[key];
    throw Error{ErrorKind::kUsage, path.string(), node.IsDefined() ? node.Mark().line + 1 : 0, std::move(found),
                std::move(wanted)};
  }
  double number(const char* key, double most) const {
    const YAML::Node node = root[key];
    double value = 0;
    if (!node.IsDefined() || !node.IsScalar() || !parse_number(node.Scalar(), value))
      complain(key, fmt::format("no number `{}`", key), keys);
    if (!(value > 0 && value <= most))
      complain(key, fmt::format("{} = {}", key, node.Scalar()), fmt::format("above 0, at most {}", most));
    return value;
  }
  int count(const char* key) const {
    const double value = number(key, kMostSquares);
    if (value != std::floor(value)) complain(key, fmt::format("{} = {}", key, value), "a whole number");
    return static_cast<int>(value);
  }
  void check_tags(const char* key, int tags) const {
    if (tags > kTagsOfFamily)
      complain(key, fmt::format("{} tags", tags), fmt::format("at most {} tags", kTagsOfFamily));
  }
  std::string text(const char* key) const {
    const YAML::Node node = root[key];
    return node.IsDefined() && node.IsScalar() ? node.Scalar() : "";
  }
};

AprilGrid april_grid_of(const Description& d) {
  AprilGrid grid;
  grid.columns = d.count("tagCols");
  grid.rows = d.count("tagRows");
  d.check_tags("tagCols", grid.tags());
  grid.tag_m = d.number("tagSize", kLargest_m);
  grid.spacing = d.number("tagSpacing", kWidestGap);
  return grid;
}

CharucoBoard charuco_of(const Description& d) {
  if (d.text("dictionary") != "apriltag_36h11") {
    d.complain(
        "dictionary", fmt::format("the dictionary \"{}\"", d.text("dictionary")),
        "dictionary: 'apriltag_36h11', OpenCV's DICT_APRILTAG_36h11: markers of other dictionaries are not read; "
        "`epiline board --kind charuco` prints a board");
  }
  CharucoBoard board;
  board.columns = d.count("squaresX");
  board.rows = d.count("squaresY");
  if (board.columns < 3 || board.rows < 3)
    d.complain("squaresX", fmt::format("{} x {} squares", board.columns, board.rows), "three at least, both ways");
  d.check_tags("squaresX", board.tags());
  board.square_m = d.number("squareSize", kLargest_m);
  constexpr double kLeastMargin = 0.05;  // of a square, on each side: a tag needs white around it
  board.tag_m = d.number("markerSize", (1 - 2 * kLeastMargin) * board.square_m);
  return board;
}

Board board_of(const YAML::Node& root, const std::filesystem::path& path) {
  const Description grid{root, path, kGridKeys}, charuco{root, path, kCharucoKeys};
  const std::string type = root.IsMap() ? grid.text("target_type") : "";
  if (type == "aprilgrid") return april_grid_of(grid);
  if (type == "charuco") return charuco_of(charuco);
  throw Error{ErrorKind::kUsage, path.string(), 0, "not a board of AprilTags",
              "target_type: 'aprilgrid' or target_type: 'charuco'"};
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

CharucoBoard::Place CharucoBoard::place_of(int tag) const {
  const int before = 2 * tag + 1;  // counted along the rows, a white square follows a black one ...
  const int row = before / columns, column = before % columns;
  // ... but where a row of an even number begins as the one above it has ended
  return {columns % 2 == 0 && row % 2 == 1 ? column - 1 : column, row};
}

Target CharucoBoard::target() const {
  Target target;
  for (int row = 1; row < rows; ++row)
    for (int column = 1; column < columns; ++column)
      target[static_cast<std::uint32_t>((row - 1) * (columns - 1) + column - 1)] = {column * square_m,
                                                                                    (rows - row) * square_m, 0};
  return target;
}

Result<Board> read_board(const std::filesystem::path& path) {
  const auto text = read_text(path);
  if (!text) return text.error();
  try {
    return board_of(YAML::Load(*text), path);
  } catch (const YAML::ParserException& e) {
    return Error{ErrorKind::kUsage, path.string(), e.mark.line + 1, "not YAML (" + e.msg + ")",
                 "a board's description"};
  } catch (const Error& e) {
    return e;
  }
}

std::string board_yaml(const Board& board) {
  if (const auto* grid = std::get_if<AprilGrid>(&board)) {
    return fmt::format(
        "target_type: 'aprilgrid'\ntagCols: {}\ntagRows: {}\ntagSize: {}      # m, the black square; measure it\n"
        "tagSpacing: {}   # of tagSize\n",
        grid->columns, grid->rows, grid->tag_m, grid->spacing);
  }
  const auto& charuco = std::get<CharucoBoard>(board);
  return fmt::format(
      "target_type: 'charuco'\ndictionary: 'apriltag_36h11'\nsquaresX: {}\nsquaresY: {}\n"
      "squareSize: {}   # m, a square of the chessboard; measure it\nmarkerSize: {}   # m, the black border of a tag\n",
      charuco.columns, charuco.rows, charuco.square_m, charuco.tag_m);
}

}  // namespace epiline
