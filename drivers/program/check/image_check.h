#pragma once
// What images say of the camera: pace, brightness, sharpness, and how much there is to track.
#include <cstdint>
#include <vector>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/sensors/camera/image_statistics.h"
#include "pipeline/vision/tracker.h"

namespace epiline {

struct ImageResult {
  PacingResult pacing;
  std::uint64_t lost = 0;                                    ///< gaps of the sequence
  double brightness = 0, dark_share = 0, clipped_share = 0;  ///< medians
  double edge_width_px = 0;                                  ///< of strong edges, median; 0: there are none
  double features = 0;                                       ///< in an image, median
  double kept_share = 0;                                     ///< of them found again in the next image, mean
};

/// Width in pixels of the strong edges along rows, median over a sample: a step of a sharp image is 2 to 3 wide. 0: too
/// few of them.
double edge_width(const Frame& image);

/// Images of one size; the tracker is run on them as they come.
class ImageCheck {
 public:
  ImageCheck(const Camera& camera, const TrackerConfig& config);
  /// Image and what was tracked in it: valid until the next call; the pixels must be so, too.
  const TrackedFrame& step(const Frame& image);
  ImageResult result() const;
  double newest_edge_px() const { return newest_edge_px_; }  ///< of the last image; 0: no strong edges

 private:
  Tracker tracker_;
  TrackedFrame tracked_;
  Pacing pacing_;
  double newest_edge_px_ = 0;
  std::uint64_t images_ = 0, lost_ = 0, last_sequence_ = 0;
  std::vector<double> brightness_, dark_, clipped_, widths_, features_;
};

/// `rate_hz`: configured; 0: any. `wanted_features`: TrackerConfig::max_features.
Findings findings_of(const ImageResult& result, double rate_hz, int wanted_features);

}  // namespace epiline
