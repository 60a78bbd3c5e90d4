#pragma once
#include "drivers/study/report/errors_json.h"
#include "estimator/statistics.h"

namespace epiline {

/// What became of the samples of height sensors, by the name of the sensor; empty without any.
Json heights_json(const EstimatorStats& stats);
/// The same of the speeds of wheels.
Json wheels_json(const EstimatorStats& stats);

}  // namespace epiline
