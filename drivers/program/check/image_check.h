#pragma once
// Judges a camera by its images (rate, brightness, sharpness, number of tracks) and by what its driver tells.
#include <cstdint>
#include <vector>

#include "drivers/program/check/finding.h"
#include "drivers/program/check/pacing.h"
#include "drivers/sensors/camera/camera_exposure.h"
#include "drivers/sensors/camera/grey_copies.h"
#include "drivers/sensors/camera/image_statistics.h"
#include "pipeline/config/devices.h"
#include "pipeline/vision/tracker.h"

namespace epiline {

struct ImageResult {
  PacingResult pacing;
  std::uint64_t lost = 0;                                    ///< gaps of the sequence
  double brightness = 0, dark_share = 0, clipped_share = 0;  ///< medians
  double edge_width_px = 0;                                  ///< of strong edges, median; 0: there are none
  double features = 0;                                       ///< median number in an image
  double kept_share = 0;  ///< mean share of features that are found again in the next image
};

/// Median width in pixels of a sample of the strong edges along rows; in a sharp image 2 to 3. 0: too few strong edges.
double edge_width(const Frame& image);

/// Runs the tracker on each image. All images must have the same size.
class ImageCheck {
 public:
  ImageCheck(const Camera& camera, const TrackerConfig& config);
  /// Returns the image's tracks, valid until the next call. The caller must keep the pixels as long.
  const TrackedFrame& step(const Frame& image);
  ImageResult result(HostStamp now = {}) const;              ///< `now`: see Pacing
  double newest_edge_px() const { return newest_edge_px_; }  ///< of the last image; 0: no strong edges

 private:
  Tracker tracker_;
  TrackedFrame tracked_;
  Pacing pacing_;
  double newest_edge_px_ = 0;
  std::uint64_t images_ = 0, lost_ = 0, last_sequence_ = 0;
  std::vector<double> brightness_, dark_, clipped_, widths_, features_;
};

/// `rate_hz`: configured rate; 0: any. `wanted_features`: TrackerConfig::max_features.
Findings findings_of(const ImageResult& result, double rate_hz, int wanted_features);

// What the camera's driver tells of exposure and memory.

/// `is_automatic`: our controller is configured.
Findings findings_of(const ExposureReport& exposure, bool is_automatic);
/// Which clock the timestamps are of.
Finding finding_of_stamps(const CameraConfig& config);
/// None of a camera without autofocus.
Findings findings_of(Focus focus);
/// None if it was not measured.
Findings findings_of(const BufferReading& reading);

}  // namespace epiline
