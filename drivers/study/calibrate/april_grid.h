#pragma once
#include <filesystem>

#include "drivers/study/calibrate/corner_views.h"
#include "platform/error/result.h"

namespace epiline {

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

/// As read_board(), and fails for any other board.
Result<AprilGrid> read_april_grid(const std::filesystem::path& path);

inline constexpr int kTagsOfFamily = 587;  ///< 36h11
/// Black cells around a tag's bits: Kalibr's tags have two, all others one.
inline constexpr int kKalibrBorder = 2, kUsualBorder = 1;

}  // namespace epiline
