#pragma once
// A flight in which camera or IMU falls silent now and then: how far off is the first pose after each silence, and does
// its covariance cover that?
#include <cstdint>
#include <vector>

#include "drivers/study/replay/replay.h"
#include "pipeline/text/trajectory.h"

namespace epiline::test {

struct Silence {
  bool of_imu = false;  ///< else of the camera
  double from_s = 0;    ///< after the first image
  double duration_s = 0;
};

/// What the first pose after a silence has lost since the last pose before it, whose position and heading count as
/// exact.
struct SilenceVerdict {
  Silence silence;
  bool judged = false;          ///< the health was tracking before, and there is a pose within 8 s after
  double position_error_m = 0;  ///< length
  double heading_error_deg = 0;
  double position_sigma_m = 0;  ///< claimed, largest axis
  double heading_sigma_deg = 0;
  double position_nees = 0;  ///< per degree of freedom; infinite if the two claims do not go together
  double heading_nees = 0;
  double first_pose_s = 0;    ///< from the end of the silence
  double longest_step_s = 0;  ///< between the two poses compared
  bool reset = false;
  HealthState state = HealthState::kInitialising;  ///< of the first pose
  double tracking_s = -1;                          ///< from the end of the silence; negative: not before the next one
};

/// Replays `options` with these silences, in order of time, and compares with the truth of the data set. Empty: there
/// is none, or it does not replay.
std::vector<SilenceVerdict> fly_with_silences(ReplayOptions options, const std::vector<Silence>& silences);

}  // namespace epiline::test
