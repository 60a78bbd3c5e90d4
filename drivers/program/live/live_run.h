#pragma once
// Runs a live flight, from opening the devices to writing the results.
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "drivers/program/live/devices.h"
#include "drivers/study/report/flight_record.h"
#include "platform/time/monotonic.h"

namespace epiline {

class LiveView;

struct LiveOptions {
  std::filesystem::path out;                                    ///< folder of the result files; empty: none are written
  double duration_s = std::numeric_limits<double>::infinity();  ///< the flight ends after this time
  LiveView* view = nullptr;                                     ///< opened, not started; null: none
  bool waits_for_devices = false;  ///< wait for missing devices; false: a missing device is an error
  bool keeps_images = true;        ///< the record gets all images and events, which take memory; false: few events
  /// Maps the samples' timestamps to the computer's clock; none: they are of that clock.
  std::optional<Pace> pace;
};

/// State of a running flight, for the display.
struct LiveState {
  bool has_pose = false;
  Odometry odometry;  ///< newest, with the present health; valid if has_pose
  std::uint64_t images = 0, readings = 0;
  Span since_start;
  std::string
      waiting_for;  ///< device that is not open yet, and why; then nothing else is known. Empty: the flight goes on
  std::vector<std::string> numbers_wrong;  ///< configured numbers found to be wrong since the last call, as sentences
  std::string lost_outputs;                ///< names of the outputs without a connection at present; empty: none
  std::string refusals;                    ///< why receivers cannot use the odometry as configured; empty: they can
  std::vector<std::string> notes;          ///< what receivers said of their settings and of what they use
};

/// Opens the devices and flies until a signal of EndSignals, the end of the sources, the end of the duration, or until
/// `watch`, called twenty times a second, returns false. SIGUSR1 requests a record. Reports to the service manager.
/// Fails if and only if a source cannot be opened or did not come before the end, settings are inconsistent, the system
/// cannot start a thread, or the folder `out` cannot be made. While it waits for a source, `watch` is called too, and
/// duration and signals end it. With `waits_for_devices` the flight begins without receivers that are not there yet. A
/// file that cannot be written ends nothing: FlightRecord::unwritten.
Result<FlightRecord> fly(const LiveSettings& settings, LiveDevices& devices, const LiveOptions& options,
                         const std::function<bool(const LiveState&)>& watch);

}  // namespace epiline
