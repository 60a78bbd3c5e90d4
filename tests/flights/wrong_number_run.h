#pragma once
// A flight with a calibration or units that are wrong: how far off is it, what does it claim, and what does it say?
#include <functional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/asl_dataset.h"
#include "drivers/study/evaluate/consistency.h"
#include "drivers/study/replay/replay.h"
#include "tests/flights/fault_run.h"

namespace epiline::test {

/// One number, or one part of the calibration, that is wrong.
struct WrongNumber {
  std::string name;
  std::function<void(AslDataset&)> apply;
  bool gross = false;  ///< no flight is to be expected: it must be named
};

/// Rotation, lever arm, lens, noise densities, time offset, units and axes, each by several sizes.
const std::vector<WrongNumber>& wrong_numbers();

struct WrongNumberVerdict {
  bool ran = false;
  double ate_m = -1;          ///< rms, aligned in yaw and translation; negative: no pose
  Consistency nees;           ///< over the whole flight
  double tracking_share = 0;  ///< of the images after the start
  double wrong_share = 0;  ///< of the odometry called tracking, later than 3 s after the first pose: beyond 3.5 sigma
  double worst_ratio = 0;  ///< error over sigma among these
  std::uint32_t reasons = 0;  ///< all that were given
  std::uint32_t resets = 0;
  std::vector<std::string> suspects;  ///< what the flight says is wrong, in words
};

/// Replays `options`, of a data set with ground truth, with the number wrong.
WrongNumberVerdict fly_with_wrong_number(ReplayOptions options, const WrongNumber& wrong);

}  // namespace epiline::test
