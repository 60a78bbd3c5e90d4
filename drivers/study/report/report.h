#pragma once
#include <optional>
#include <string>

#include "drivers/study/report/flight_record.h"
#include "drivers/study/report/program_info.h"

namespace epiline {

/// report.html: one self-contained page.
std::string report_html(const FlightRecord& record, const std::optional<TrajectoryErrors>& errors,
                        const ProgramInfo& program);

}  // namespace epiline
