#pragma once
// Functions that flights in threads share, with recorded or live sensors.
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/study/report/flight_record.h"
#include "pipeline/config/calibration.h"
#include "pipeline/config/config.h"
#include "pipeline/recorder/flight_recorder.h"

namespace epiline {

/// The facts with which a record of this flight can be replayed: the settings of this run, from whatever files.
RecordedRun recorded_run(const CameraParameters& camera,
                         const std::array<std::optional<CameraParameters>, kMostOthers>& others, double image_rate_hz,
                         const ImuCorrection& correction, Config config);

/// What the system refused (priorities, locked memory, processors), one line each.
std::vector<std::string> shortfalls_of(const RealtimeReport& report);

/// Copies the pipeline's report into `record`. Call it after join(). `speed`: of the samples' clock.
void take_report(const RealtimePipeline& pipeline, double speed, FlightRecord& record);

/// Writes the recorder's last record, and copies its report into `record`.
void finish(FlightRecorder& recorder, FlightRecord& record);

}  // namespace epiline
