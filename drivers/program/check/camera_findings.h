#pragma once
// What the camera's driver tells of exposure and memory, for `epiline check`.
#include "drivers/program/check/finding.h"
#include "drivers/sensors/camera/camera_exposure.h"
#include "drivers/sensors/camera/grey_copies.h"
#include "pipeline/config/devices.h"

namespace epiline {

/// `is_automatic`: our controller is configured.
Findings findings_of(const ExposureReport& exposure, bool is_automatic);
/// Which clock the timestamps are of.
Finding finding_of_stamps(const CameraConfig& config);
/// None of a camera without autofocus.
Findings findings_of(Focus focus);
/// None if it was not measured.
Findings findings_of(const BufferReading& reading);

}  // namespace epiline
