#pragma once
// Measures tracker and estimator on this computer, on a flight that it makes up itself.
#include <cstddef>
#include <functional>
#include <string>

#include "drivers/program/bench/board.h"
#include "drivers/study/report/flight_record.h"

namespace epiline {

/// Flies the made-up flight in this thread, as fast as possible. Calls `progress` with the number of finished and of
/// all images.
FlightRecord fly_made_up(double duration_s, const std::function<void(std::size_t, std::size_t)>& progress);

/// The root mean square of its position errors, m. Fails (ErrorKind::kRun) if the odometry is not what it should be.
Result<double> position_error(const FlightRecord& record);

/// What `epiline bench` prints: figures, a line each, and the row for the table of boards.
std::string bench_text(const FlightRecord& record, double error_m, const std::string& board, const BoardState& before,
                       const BoardState& after);

}  // namespace epiline
