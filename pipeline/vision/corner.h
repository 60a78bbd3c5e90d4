#pragma once
// Corner score, over 6x6 px and at every second pixel: smaller eigenvalue of the structure tensor, less a share of the
// larger one. A straight edge has none of its own along itself: what noise and pixel steps add there grows with its
// contrast (docs/developers/vision.md).
#include "pipeline/vision/image_view.h"

namespace epiline {

inline constexpr int kMaxCellSide = 160;  ///< px
inline constexpr int kCellMargin = 4;     ///< px of image that a cell needs on every side

/// Sides even, at most kMaxCellSide.
struct Cell {
  int x = 0, y = 0, width = 0, height = 0;
};

struct Corner {
  float x = 0, y = 0;  ///< px, centre of its 2x2 block
  float score = 0;     ///< (grey/px)^2; 0: no corner
};

/// Discs that may hold no new corner: centres in px.
struct Discs {
  const float* x = nullptr;
  const float* y = nullptr;
  int count = 0;
  float radius = 0;  ///< px
};

/// Best corner of a cell outside the discs, the first one of equals. The cell needs kCellMargin px of image on every
/// side; up to 30 px past the end of a row are read, which below the cell is the next row. `edge_share`: of the larger
/// eigenvalue, subtracted from the smaller one.
Corner best_corner(const ImageView& image, const Cell& cell, const Discs& taken, float edge_share) noexcept;

}  // namespace epiline
