#pragma once
// The front end's constants and counters. No Eigen: the image kernels include this and are compiled with flags of their
// own.
#include <array>
#include <bitset>
#include <cstdint>
#include <memory>

#include "platform/samples/samples.h"

namespace epiline {

class Mask;

/// Every constant of the front end. Grey values are 0 to 255; px are pixels of the camera's image unless a level is
/// named.
struct TrackerConfig {
  int max_features = 150;    ///< tracks to keep alive, 1 to kMaxFeatures
  int second_features = 15;  ///< tracks of a second camera alone while the first one sees well, 0 to kMaxFeatures
  int levels = 4;            ///< of the pyramid, 1 to 6; levels with a side below 32 px are left out

  // KLT
  int iterations = 10;            ///< at most, a level
  float step_px = 0.02f;          ///< level 0 has converged below this step
  float coarse_step_px = 0.05f;   ///< the other levels (their px), and the way back
  float max_step_px = 10.f;       ///< a longer step is divergence
  float min_eigenvalue = 0.1f;    ///< of the template's matrix, a pixel, (grey/px)^2; below it a level says nothing
  float start_level_0_px = 0.5f;  ///< last innovation below this: start at level 0 ...
  float start_level_1_px = 1.5f;  ///< ... below this: at level 1 ...
  float start_level_2_px = 4.f;   ///< ... below this: at level 2, otherwise at the coarsest

  // Checks of a track
  float min_correlation = 0.7f;  ///< between template and found patch at level 0, -1 to 1
  int backward_iterations = 4;   ///< at most, at level 0
  float max_backward_px = 0.7f;  ///< tracked back to the previous image, it may miss its old position by this

  // Two-point rejection
  int hypotheses = 40;          ///< directions of travel tried for each span
  float near_limit_px = 0.75f;  ///< Sampson distance, angle times focal length, against the previous image
  float wide_limit_px = 1.5f;   ///< the same against the image `wide_span` images ago
  float doubt_share = 0.03f;    ///< more outliers than this share: the rotation is fitted as well
  int wide_span = 6;            ///< images, 2 to 7

  // Detection
  int border_px = 12;                     ///< no new features nearer to the border; at least 4
  float cells_per_feature = 16.f / 15.f;  ///< size of the detection grid; one new feature a cell and image
  float min_distance_px = 20.f;           ///< of a new feature from any track
  float min_score = 6.f;                  ///< smaller eigenvalue of the mean structure tensor, (grey/px)^2, less ...
  float edge_share = 0.1f;                ///< ... this share of the larger one: an edge is no corner

  std::array<std::shared_ptr<const Mask>, 1 + kMostOthers> masks;  ///< of each camera; null: it sees the world only
};

/// Cells of a grid over the image in which the vehicle itself was seen, row by row.
struct OwnCells {
  int image_width = 0, image_height = 0;  ///< px
  int columns = 0, rows = 0;
  int border_px = 0, width_px = 0, height_px = 0;  ///< around the grid; of a cell
  std::bitset<1024> own;                           ///< the first ones, should there be more

  void set(int cell, bool is_own) noexcept {
    if (static_cast<std::size_t>(cell) < own.size()) own.set(static_cast<std::size_t>(cell), is_own);
  }
};

/// Counts since construction.
struct TrackerStats {
  std::uint64_t images = 0;          ///< given to step()
  std::uint64_t images_refused = 0;  ///< no data, or not the camera's size
  std::uint64_t gaps = 0;            ///< images that came after a pause of more than 1.5 usual intervals
  std::uint64_t tried = 0;           ///< tracks looked for in a next image
  std::uint64_t tracked = 0;         ///< found there and kept
  std::uint64_t detected = 0;        ///< new tracks
  std::uint64_t lost_border = 0;  ///< left the image, came within about 9 px of its border, or onto black of the mask
  std::uint64_t lost_flat = 0;    ///< no texture left
  std::uint64_t lost_diverged = 0;
  std::uint64_t lost_correlation = 0;
  std::uint64_t lost_backward = 0;
  std::uint64_t rejected_near = 0;  ///< against the previous image
  std::uint64_t rejected_wide = 0;  ///< against the image `wide_span` images ago
  OwnCells own_cells;               ///< by now
};

}  // namespace epiline
