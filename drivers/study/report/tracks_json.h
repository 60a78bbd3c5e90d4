#pragma once
#include "drivers/study/report/errors_json.h"
#include "drivers/study/report/flight_record.h"

namespace epiline {

/// The tracks of a flight: number, length, noise, rejections; of each other camera the views.
Json tracks_json(const FlightRecord& record);

}  // namespace epiline
