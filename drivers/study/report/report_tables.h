#pragma once
// The tables of a flight's report, as HTML.
#include <string>

#include "drivers/study/report/flight_record.h"

namespace epiline {

/// NEES, and the share of poses within some of the claimed regions.
std::string consistency_table(const Consistency& consistency);
std::string motion_table(const TrajectoryErrors& errors);
std::string error_table(const TrajectoryErrors& errors);
std::string timing_table(const FlightRecord& record);
std::string count_table(const FlightRecord& record);

/// Of a run in threads.
std::string thread_table(const FlightRecord& record);
std::string output_table(const RealtimeRecord& record);
std::string device_table(const RealtimeRecord& record);

}  // namespace epiline
