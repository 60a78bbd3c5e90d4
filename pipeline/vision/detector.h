#pragma once
#include <array>
#include <span>
#include <vector>

#include "pipeline/vision/corner.h"
#include "pipeline/vision/mask.h"
#include "pipeline/vision/own_parts.h"
#include "pipeline/vision/track_table.h"
#include "pipeline/vision/tracker_config.h"

namespace epiline {

/// Finds new corners in the empty cells of a grid over the image, visited in an order that moves from image to image.
class Detector {
 public:
  /// The grid has about config.cells_per_feature cells a feature. Throws std::invalid_argument if the image has no room
  /// for one. No corners are found where `mask` does not see the world.
  Detector(int width, int height, const TrackerConfig& config, const Mask* mask = nullptr);

  /// Appends corners to `tracks` until there are `most`, none near those that are `taken`: position only (x, y), the
  /// rest of their columns is for the caller to fill. Returns how many.
  int detect(const ImageView& image, std::span<const std::array<float, 2>> taken, int most,
             TrackTable& tracks) noexcept;

  /// A track at (x, y) speaks of the vehicle, or of the world (OwnParts). No corners are searched any more where the
  /// vehicle itself is seen.
  void watch(float x, float y, const Vec2& turned, bool vehicle) noexcept;
  /// Where that is, as a grid for TrackerStats.
  const OwnCells& own_cells() const noexcept { return own_cells_; }

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  /// The part of it that is searched; its sides may be 0.
  const Cell& cell(int index) const { return cells_[static_cast<std::size_t>(index)]; }

 private:
  int cell_at(float x, float y) const noexcept;
  Discs discs_near(const Cell& cell, std::span<const std::array<float, 2>> taken, const TrackTable& tracks) noexcept;

  TrackerConfig config_;
  int columns_ = 0, rows_ = 0;
  int cell_width_ = 0, cell_height_ = 0;
  int stride_ = 1;  // from one visited cell to the next; has no common divisor with the number of cells
  int first_ = 0;   // cell to start with in this image
  std::vector<Cell> cells_;
  std::vector<std::uint8_t> used_;
  OwnParts own_{0};
  OwnCells own_cells_;
  std::array<float, 2 * TrackTable::kCapacity> near_x_{}, near_y_{};
};

}  // namespace epiline
