#pragma once
// Boards with AprilTags (family 36h11) that are printed and waved: Kalibr's AprilGrid, and OpenCV's ChArUco.
#include <filesystem>
#include <string>
#include <variant>

#include "drivers/study/calibrate/april_grid.h"
#include "drivers/study/calibrate/corner_views.h"
#include "platform/error/result.h"

namespace epiline {

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
