#pragma once
// Boards with AprilTags (family 36h11) that are printed and waved: Kalibr's AprilGrid, and OpenCV's ChArUco.
#include <filesystem>
#include <string>
#include <variant>

#include "drivers/study/calibrate/corner_views.h"
#include "platform/error/result.h"

namespace epiline {

inline constexpr int kTagsOfFamily = 587;  ///< 36h11
/// Black cells around a tag's bits: Kalibr's tags have two, all others one.
inline constexpr int kKalibrBorder = 2, kUsualBorder = 1;

/// A board of AprilTags (family 36h11) as Kalibr describes it: tags in rows, ids rising along x and then y from the
/// lower left, the gaps' corners filled with black squares.
struct AprilGrid {
  int columns = 6, rows = 6;
  double tag_m = 0.024;  ///< side of a tag's black border
  double spacing = 0.3;  ///< between tags, as a share of their side
  int tags() const { return columns * rows; }
  double step_m() const { return tag_m * (1 + spacing); }
  double width_m() const { return columns * tag_m + (columns - 1) * spacing * tag_m; }
  double height_m() const { return rows * tag_m + (rows - 1) * spacing * tag_m; }
  double margin_m() const { return 2 * spacing * tag_m; }  ///< white around it
  /// Corners 4 * tag + 0 to 3: lower left, lower right, upper right, upper left. T: x right, y up, origin at the
  /// lower left.
  Target target() const;
};

/// As OpenCV draws it with DICT_APRILTAG_36h11 since 4.6: a chessboard, its upper left square black, with a tag in the
/// middle of each white square, turned by half a turn; ids rise along the rows from the top.
struct CharucoBoard {
  int columns = 7, rows = 9;  ///< squares
  double square_m = 0.026, tag_m = 0.019;
  int tags() const { return columns * rows / 2; }
  double width_m() const { return columns * square_m; }
  double height_m() const { return rows * square_m; }
  double margin_m() const { return square_m / 2; }  ///< white around it
  /// The column and row (from the top) of the white square that holds a tag.
  struct Place {
    int column = 0, row = 0;
  };
  Place place_of(int tag) const;
  /// Corners inside the board, where two black squares touch, along the rows from the top. T: x right, y up, origin at
  /// the lower left of the board.
  Target target() const;
};

using Board = std::variant<AprilGrid, CharucoBoard>;

inline int tags_of(const Board& board) {
  return std::visit([](const auto& b) { return b.tags(); }, board);
}
inline Target target_of(const Board& board) {
  return std::visit([](const auto& b) { return b.target(); }, board);
}

/// Kalibr's description of an AprilGrid (`target_type: 'aprilgrid'`, `tagCols`, `tagRows`, `tagSize`, `tagSpacing`), or
/// one of a ChArUco board (`target_type: 'charuco'`, `dictionary: 'apriltag_36h11'`, `squaresX`, `squaresY`,
/// `squareSize`, `markerSize`). Fails if and only if the file cannot be read, is not YAML, or a key is missing or
/// impossible.
Result<Board> read_board(const std::filesystem::path& path);
std::string board_yaml(const Board& board);

}  // namespace epiline
