#pragma once
#include "drivers/study/report/errors_json.h"
#include "drivers/study/report/flight_record.h"
#include "drivers/study/report/program_info.h"

namespace epiline {

/// Times of a stage, ms, of those images for which it ran.
std::vector<double> times_of(const FlightRecord& record, double StageMilliseconds::*stage,
                             StageMilliseconds ImageRecord::*clock = &ImageRecord::wall_ms);
/// From an image's stamp to its odometry, ms, of those images whose odometry was published in a real-time run.
std::vector<double> latencies_of(const FlightRecord& record);

/// Distributions of the time per stage, ms; those of stages that did not run are empty.
struct StageSummaries {
  Summary track, solve, marginalise, estimate, frame;
};
struct Timing : StageSummaries {
  StageSummaries cpu;  ///< processor time of the stage's thread; the others are wall time
  Summary latency;
};
Timing timing_of(const FlightRecord& record);

/// Seconds spent in each health state, by index of HealthState.
std::array<double, 4> state_seconds(const FlightRecord& record);

/// Seconds from the first image to the first pose.
std::optional<double> start_seconds(const FlightRecord& record);

/// Poses over images, from the first pose on.
std::optional<double> coverage(const FlightRecord& record);

/// version, commit, compiler, build_type, simd
Json to_json(const ProgramInfo& program);

/// The whole of stats.json (docs/replay.md lists the fields). `errors` as errors_of() gives them.
Json stats_json(const FlightRecord& record, const std::optional<TrajectoryErrors>& errors, const ProgramInfo& program);

}  // namespace epiline
