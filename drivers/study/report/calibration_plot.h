#pragma once
#include <string>

#include "drivers/study/evaluate/consistency.h"

namespace epiline {

/// How to read the plot, for the line above it.
extern const char* const kCalibrationNote;

/// Share of errors inside the claimed regions over the claimed probability, a line for each quantity, as SVG. Empty
/// without any curve.
std::string calibration_svg(const CalibrationCurves& curves);

}  // namespace epiline
