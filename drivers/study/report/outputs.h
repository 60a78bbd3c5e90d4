#pragma once
// The files that a flight leaves behind.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "platform/error/result.h"

namespace epiline {

/// Names of all the files that a flight may leave.
inline const std::vector<std::string> kFlightFiles = {"trajectory.tum", "odometry.csv", "odometry_imu_rate.tum",
                                                      "events.txt",     "stats.json",   "report.html",
                                                      "own_parts.png"};

/// Writes stats.json, report.html and, if the vehicle was seen, own_parts.png into the folder; returns the errors for a
/// summary. Fails if and only if one of them cannot be written.
Result<std::optional<TrajectoryErrors>> write_report(const FlightRecord& record, const std::filesystem::path& folder);

/// Writes trajectory.tum, events.txt, stats.json and report.html into the folder, made if need be; returns the errors
/// for a summary. Fails if and only if one of them cannot be written.
Result<std::optional<TrajectoryErrors>> write_outputs(const FlightRecord& record, const std::filesystem::path& folder);

}  // namespace epiline
