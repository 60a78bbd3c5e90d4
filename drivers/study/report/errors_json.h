#pragma once
#include <nlohmann/json.hpp>

#include "drivers/study/evaluate/errors.h"
#include "platform/error/result.h"

namespace epiline {

using Json = nlohmann::ordered_json;

/// rmse, mean, median, p95, max
Json to_json(const Summary& summary);

/// errors, share; null without errors
Json to_json(const CalibrationCurve& curve);
/// probability, and a curve each for position, yaw, velocity and tilt
Json to_json(const CalibrationCurves& curves);
/// The `error` block of stats.json; `coverage` is null, the caller knows the images. Without poses every figure is
/// null.
Json to_json(const TrajectoryErrors& errors);

/// What `epiline evaluate --json` prints. `align`: the name of an Alignment.
Json evaluation_json(const TrajectoryErrors& errors, const std::string& align);
/// The error of an estimate that cannot be evaluated.
Error no_common_time(const std::string& estimate);

}  // namespace epiline
