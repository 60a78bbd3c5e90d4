#pragma once
// What flights in threads have in common, whether their sensors are recorded or live.
#include <cstdint>
#include <string>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "pipeline/config/config.h"
#include "pipeline/recorder/flight_recorder.h"

namespace epiline {

/// What a record of this flight is replayed with: the settings of this run, whatever files they came from.
RecordedRun recorded_run(const CameraParameters& camera, double image_rate_hz, Config config);

/// What was asked of the system and not given, a line each.
std::vector<std::string> shortfalls_of(const RealtimeReport& report);

/// After join(): takes over what the pipeline says of the flight. `speed`: of the samples' clock.
void take_report(const RealtimePipeline& pipeline, double speed, FlightRecord& record);

/// Writes what the recorder holds at the end, and takes over what it says of itself.
void finish(FlightRecorder& recorder, FlightRecord& record);

}  // namespace epiline
