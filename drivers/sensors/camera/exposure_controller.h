#pragma once
// Controls exposure and gain so that images have much texture to track. docs/camera.md.
#include <array>
#include <cstddef>
#include <optional>

#include "drivers/sensors/camera/exposure_timeline.h"
#include "drivers/sensors/camera/image_statistics.h"

namespace epiline {

/// Limits of the camera, and settings of the user.
struct ExposureLimits {
  Span shortest{20'000}, longest{10'000'000};
  double gain_least = 1, gain_most = 1;
  double blur_px = 0;       ///< largest motion blur by rotation; 0: no limit
  double focal_px = 0;      ///< pixels per radian; 0: unknown
  double brightness = 100;  ///< mean grey value, where the picture has no texture
  double flicker_hz = 0;    ///< of the lamps; exposures longer than a period become whole periods. 0: no lamps
};

/// By which factor the light on the sensor should change, natural logarithm, from -log(4) to log(4): where the image
/// would have the most information. An edge is worth the logarithm of its height, nothing if it is clipped; a picture
/// without edges is judged by its mean. `brightness`: as in ExposureLimits.
double wanted_log_factor(const ImageStatistics& image, double brightness) noexcept;

/// A pure object: no clock, no heap. It looks only at images that show its last change, takes the mean of a few, and
/// moves when they are off by more than a band, in steps that a tracker follows. So it cannot chase its own delay.
class ExposureController {
 public:
  explicit ExposureController(const ExposureLimits& limits) noexcept;

  /// Takes an image's statistics and exposure. `turn_rate_rad_s`: rotation rate of the camera, 0 if unknown. Returns
  /// the exposure to set; none: no change.
  std::optional<ExposureState> step(const ImageStatistics& image, const ExposureTimeline::OfImage& exposure,
                                    double turn_rate_rad_s) noexcept;

  /// Splits `total` (seconds times gain) into exposure time and gain within the limits. The time is raised first,
  /// because gain amplifies noise.
  ExposureState split(double total) const noexcept;
  /// The longest exposure time at the recent rotation rate.
  Span longest() const noexcept;

 private:
  double step_of(double wanted) noexcept;

  ExposureLimits limits_;
  double turn_rate_ = 0;  ///< the highest recent rotation rate, rad/s
  double sum_ = 0;        ///< of wanted factors, logarithms
  int images_ = 0;
  bool is_moving_ = false;
  int calm_ = 0;   ///< decisions since it moved
  int turns_ = 0;  ///< changes of direction since it was at rest
  // logarithms: the last change, how far the next may go, and what is near enough
  double last_step_ = 0, reach_ = 2, band_ = 0;
};

}  // namespace epiline
