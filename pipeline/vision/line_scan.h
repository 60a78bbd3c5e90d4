#pragma once
// Looks for a patch at many places of another image, for instance along an epipolar line.
#include "pipeline/vision/image_view.h"

namespace epiline {

struct ScanPlace {
  float x = 0, y = 0;      ///< px of the image that is searched; finite
  float correlation = -1;  ///< out: as KltTrack::correlation, at the nearest pixel; -1 where no patch fits
};

/// Compares the patch around (x, y) of `image` with those of `other` at `count` places. False: no patch fits there, or
/// it has no texture; the correlations are -1.
bool scan_places(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places,
                 int count) noexcept;

}  // namespace epiline
