#pragma once
// `epiline check`: examines every configured device and reports what is wrong with it. docs/devices.md
#include <filesystem>
#include <functional>

#include "drivers/program/check/finding.h"
#include "drivers/program/inventory/inventory.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/devices.h"
#include "platform/samples/samples.h"

namespace epiline {

/// Receives the data of a running check: the interface of its page.
class CheckWitness {
 public:
  virtual ~CheckWitness() = default;

  /// Called by the camera's thread. Image and tracks are valid during this call only. `edge_px`: width of the image's
  /// strong edges; 0: there are none.
  virtual void image(const Frame& frame, const TrackedFrame& tracked, double edge_px) = 0;
  /// Called by the IMU's thread.
  virtual void reading(const ImuSample& sample) = 0;
  /// Called about once a second with the findings so far.
  virtual void findings(double seconds, const Findings& findings) = 0;
  /// True once after each request to discard all data collected so far.
  virtual bool takes_new_start() = 0;
};

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
