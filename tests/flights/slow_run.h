#pragma once
// A simulated vehicle that flies lively for 15 s and then moves at a constant, very small velocity without turning, or
// stands: is it taken for standing, and does its covariance cover what that costs? No images: tracks with known errors.
#include <cstdint>

#include "estimator/config.h"

namespace epiline::test {

/// How the error of a track depends on time.
enum class TrackError : std::uint8_t {
  kWhite,  ///< independent in each image
  kDrift,  ///< a random walk: as large as the white one between two images half a second (10 images) apart
};

struct SlowFlight {
  double speed_m_s = 0.003;  ///< after the lively part
  double depth_m = 10;       ///< points lie at 0.8 to 1 of this
  double noise_px = 0.3;
  TrackError error = TrackError::kWhite;
  double direction_deg = 90;  ///< of the motion, horizontally from where the camera looks; 0: forward
  double loss_share = 0;      ///< of the tracks, lost at random in each image
  double slow_s = 60;
  std::uint64_t seed = 1;
};

/// Position errors are lengths and count from the beginning of the slow part; sigma is the largest axis of the
/// covariance published.
struct SlowVerdict {
  double error_m = 0, sigma_m = 0;  ///< at the end
  double worst_ratio = 0;           ///< largest error over sigma while the health was `tracking`
  double rest_share = 0;            ///< of the frames solved in the slow part: those taken for rest
  double tracking_share = 0;        ///< of all frames of the slow part
  int resets = 0;
};

SlowVerdict fly_slowly(const SlowFlight& flight, const EstimatorConfig& settings = {});

}  // namespace epiline::test
