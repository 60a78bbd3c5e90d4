#pragma once
// Kanade-Lucas-Tomasi tracking of 16x16 patches, blind to gain and bias of the grey values. Derivation: docs/vision.md.
#include <cstdint>

#include "pipeline/vision/image_view.h"
#include "pipeline/vision/tracker_config.h"

namespace epiline {

enum class KltEnd : std::uint8_t { kFound, kBorder, kFlat, kDiverged, kCorrelation, kBackward };

/// One feature to look for. Positions in px of level 0.
struct KltTrack {
  float x = 0, y = 0;              ///< in the previous image
  float found_x = 0, found_y = 0;  ///< in: predicted position in the current image; out, if found: measured
  int start_level = kMaxLevels;    ///< first level tried; a failure is tried once more from the coarsest
  float correlation = 0;           ///< out, if found or kCorrelation or kBackward
  KltEnd end = KltEnd::kBorder;    ///< out
};

/// Looks for `count` features of `previous` in `current`; both pyramids have the same sizes. Positions that are not
/// finite end as kBorder.
void track_klt(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) noexcept;

}  // namespace epiline
