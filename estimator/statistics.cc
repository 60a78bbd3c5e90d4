#include "estimator/statistics.h"

namespace epiline {

const char* to_string(StartRefusal r) {
  switch (r) {
    case StartRefusal::kTooFewFrames:
      return "too_few_frames";
    case StartRefusal::kTooFewTracks:
      return "too_few_tracks";
    case StartRefusal::kNoImu:
      return "no_imu";
    case StartRefusal::kNoParallax:
      return "no_parallax";
    case StartRefusal::kSolverFailed:
      return "solver_failed";
    case StartRefusal::kResidualTooLarge:
      return "residual_too_large";
    case StartRefusal::kTiltUncertain:
      return "tilt_uncertain";
    case StartRefusal::kVelocityUncertain:
      return "velocity_uncertain";
    case StartRefusal::kScaleUncertain:
      return "scale_uncertain";
    case StartRefusal::kBiasImplausible:
      return "bias_implausible";
    case StartRefusal::kNumbersWrong:
      return "numbers_wrong";
    case StartRefusal::kCount:
      break;
  }
  return "unknown";
}

}  // namespace epiline
