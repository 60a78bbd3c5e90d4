#pragma once
// What `epiline calibrate` leaves behind: camera.yaml and imu.yaml in Kalibr's layout, calibration.json, report.html.
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/study/calibrate/calibrate.h"
#include "platform/error/result.h"

namespace epiline {

inline const std::vector<std::string> kCalibrationFiles = {"camera.yaml", "imu.yaml", "calibration.json",
                                                           "report.html"};

/// camera.yaml, as `run` and Kalibr's users read it. Numbers have all their digits. `name`: cam0.
std::string kalibr_camera(const CameraCalibration& camera, const std::string& name);
/// imu.yaml. `rate_hz`: of the readings. Random walks are those that were given: a minute does not show them.
std::string kalibr_imu(const ImuCalibration& imu, double rate_hz);
/// Values, sigmas, verdicts: docs/calibrate.md lists the fields.
std::string calibration_json(const Calibration& calibration, const CalibrateSettings& settings);
std::string calibration_html(const Calibration& calibration, const CalibrateSettings& settings);

/// All four into the folder, made if need be. Fails if and only if one of them cannot be written.
Status write_calibration(const Calibration& calibration, const CalibrateSettings& settings,
                         const std::filesystem::path& folder);

}  // namespace epiline
