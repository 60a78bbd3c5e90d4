#pragma once
#include <nlohmann/json.hpp>

#include "drivers/study/evaluate/errors.h"

namespace epiline {

using Json = nlohmann::ordered_json;

/// rmse, mean, median, p95, max
Json to_json(const Summary& summary);

/// The `error` block of stats.json; `coverage` is null, the caller knows the images. Without poses every figure is
/// null.
Json to_json(const TrajectoryErrors& errors);

}  // namespace epiline
