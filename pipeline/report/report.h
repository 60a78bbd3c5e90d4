#pragma once
#include <optional>
#include <string>

#include "pipeline/report/flight_record.h"
#include "pipeline/report/program_info.h"

namespace epiline {

/// report.html: one self-contained page.
std::string report_html(const FlightRecord& record, const std::optional<TrajectoryErrors>& errors,
                        const ProgramInfo& program);

}  // namespace epiline
