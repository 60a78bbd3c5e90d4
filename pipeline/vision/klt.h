#pragma once
// Kanade-Lucas-Tomasi tracking of 16x16 patches, blind to gain and bias of the grey values. Derivation:
// docs/developers/vision.md.
#include <cstdint>

#include "pipeline/vision/image_view.h"
#include "pipeline/vision/tracker_config.h"

namespace epiline {

inline constexpr int kPatchSide = 16;  ///< samples
inline constexpr int kPatchPixels = kPatchSide * kPatchSide;

/// What is looked for: grey values and gradients of a patch, both x 32.
struct KltTemplate {
  alignas(64) std::int16_t grey[kPatchPixels];
  alignas(64) std::int16_t gx[kPatchPixels];  ///< per px, made orthogonal to 1 and to `grey`
  alignas(64) std::int16_t gy[kPatchPixels];
  std::int16_t origin;           ///< one of the grey values: what is summed is the difference
  float mean, energy;            ///< of `grey` - `origin`: mean, and sum of squares about it
  float inv_xx, inv_xy, inv_yy;  ///< inverse of the matrix of the corrected gradients
  float eigenvalue;              ///< smaller one of that matrix, a pixel, (grey/px)^2
  float offset_x, offset_y;      ///< quantised centre minus the true one, px of the level
};

enum class KltEnd : std::uint8_t { kFound, kBorder, kFlat, kDiverged, kCorrelation, kBackward };

/// One feature to look for. Positions in px of level 0.
struct KltTrack {
  float x = 0, y = 0;              ///< in the previous image
  float found_x = 0, found_y = 0;  ///< in: predicted position in the current image; out, if found: measured
  int start_level = kMaxLevels;    ///< first level tried; a failure is tried once more from the coarsest
  KltTemplate* patch = nullptr;    ///< of this track alone; out, if found: the template of the found position
  bool patch_known = false;        ///< in: `patch` is what the search for (x, y) left there; else it is made
  float correlation = 0;           ///< out, if found or kCorrelation or kBackward
  KltEnd end = KltEnd::kBorder;    ///< out
};

/// The first level to try, by the innovation (px) of the search before: what was predicted well is looked for in the
/// finest levels only.
inline int start_level_for(float innovation_px, const TrackerConfig& config) {
  if (innovation_px < config.start_level_0_px) return 0;
  if (innovation_px < config.start_level_1_px) return 1;
  return innovation_px < config.start_level_2_px ? 2 : kMaxLevels;
}

/// Looks for `count` features of `previous` in `current`; both pyramids have the same sizes. Positions that are not
/// finite end as kBorder. Every track needs a `patch`.
void track_klt(const TrackerConfig& config, const PyramidView& previous, const PyramidView& current, KltTrack* tracks,
               int count) noexcept;

struct ScanPlace {
  float x = 0, y = 0;      ///< px of the image that is searched; finite
  float correlation = -1;  ///< out: as KltTrack::correlation, at the nearest pixel; -1 where no patch fits
};

/// Compares the patch around (x, y) of `image` with those of `other` at `count` places, for instance along an epipolar
/// line. False: no patch fits there, or it has no texture; the correlations are -1.
bool scan_places(const ImageView& image, float x, float y, const ImageView& other, ScanPlace* places,
                 int count) noexcept;

/// Name of the instruction set that the image kernels use on this machine, for instance "AVX2".
const char* simd_target() noexcept;

}  // namespace epiline
