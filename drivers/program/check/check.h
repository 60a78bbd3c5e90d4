#pragma once
// `epiline check`: examines every configured device and reports what is wrong with it. docs/devices.md
#include <filesystem>
#include <functional>

#include "drivers/program/check/check_witness.h"
#include "drivers/program/check/finding.h"
#include "drivers/program/inventory/inventory.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/devices.h"

namespace epiline {

struct CheckOptions {
  double seconds = 10;           ///< duration of the examination of live data
  std::vector<std::string> set;  ///< settings as ConfigFile::set() takes them; they override the file
  /// Called about four times a second with the elapsed time; the check ends early if it returns false.
  std::function<bool(double seconds)> watch;
  /// Receives the live data and findings during the check; may be null.
  CheckWitness* witness = nullptr;
};

/// Findings on which configured devices exist and which this user may open.
Findings check_presence(const DevicesConfig& devices, const Inventory& inventory);

/// Opens the configured devices, examines them and closes them. Never fails: every problem is a finding. Works without
/// a calibration, but time offset and rotation of a camera can only be checked with one; its absence is a finding as
/// well. `config_file` must be readable without an error.
Findings check_devices(const std::filesystem::path& config_file, const CheckOptions& options);

/// Findings from a driver's counters and from the state of its clock.
Findings findings_of(const DeviceRecord& record);

}  // namespace epiline
