#pragma once
// `epiline check`: looks at every configured device and says what is wrong with it. docs/check.md
#include <filesystem>
#include <functional>

#include "drivers/program/check/check_witness.h"
#include "drivers/program/check/finding.h"
#include "drivers/program/inventory/inventory.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/devices.h"

namespace epiline {

struct CheckOptions {
  double seconds = 10;           ///< of looking at live data
  std::vector<std::string> set;  ///< settings as ConfigFile::set() takes them; they win over the file
  /// Called about four times a second meanwhile; false ends it early.
  std::function<bool(double seconds)> watch;
  /// Sees everything meanwhile; null: nobody does.
  CheckWitness* witness = nullptr;
};

/// What of the configured devices is there, and may be opened.
Findings check_presence(const DevicesConfig& devices, const Inventory& inventory);

/// Opens what is configured, looks at it, closes it. Never fails: what goes wrong is a finding. Needs no calibration,
/// but without one of the camera its time offset and rotation cannot be checked, which is a finding too.
/// `config_file` has been read before without an error.
Findings check_devices(const std::filesystem::path& config_file, const CheckOptions& options);

/// What a driver counted and what it says of its clock.
Findings findings_of(const DeviceRecord& record);

}  // namespace epiline
