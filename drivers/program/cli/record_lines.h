#pragma once
// Recording as a user sees it, for the commands that record.
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/program/record/recorder.h"

namespace epiline {

/// Records from the devices of a configuration, which needs no calibration. `says`: prints how long the disk lasts,
/// what is lost meanwhile, and a summary. Fails like the configuration, the devices and record().
Result<RecordSummary> record_and_say(const std::filesystem::path& config, const std::vector<std::string>& set,
                                     const RecordOptions& options, bool says);

}  // namespace epiline
