#pragma once
#include "drivers/study/calibrate/calibrate.h"

namespace epiline {

/// Fills in how good the figures are: lens_px, covered and verdicts.
void judge(Calibration& calibration);

}  // namespace epiline
