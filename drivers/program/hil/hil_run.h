#pragma once
// A recorded flight through the real interfaces, into a live run and out to the model of a flight controller. Page:
// docs/hil.md.
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "drivers/program/hil/played_sensors.h"
#include "drivers/program/hil/rules.h"
#include "drivers/program/live/live_run.h"
#include "drivers/study/report/flight_record.h"

namespace epiline::hil {

struct HilOptions {
  std::filesystem::path dataset, config_file;
  std::vector<std::string> set;  ///< as read_live_settings() takes it
  std::filesystem::path out;     ///< folder of a live run's files and the verdict; empty: none
  std::string camera = "file";   ///< or v4l2loopback:DEVICE
  std::string imu = "file";      ///< or uhid, mavlink
  /// Or pty:PATH, udp, udp:PORT, a CAN interface, a serial port wired to that of the configuration.
  std::string controller = "pty";
  /// Another process flies, with the same configuration file: plays as soon as that one has opened the IMU.
  bool beside = false;
  Releases judge = kUsualReleases;  ///< whose rules count
  double start_s = 0, duration_s = std::numeric_limits<double>::infinity();
  Disturbance disturbance;
  double controller_skew_ppm = 40;
};

struct HilResult {
  std::optional<FlightRecord> record;  ///< none: another process flew
  Verdict verdict;
  std::vector<Trajectory> received;  ///< by the controller, a part for each reset counter
  Trajectory truth;                  ///< empty: not known
  HostStamp begin;                   ///< of the flight, for the verdict's times
  std::uint64_t estimates = 0;       ///< that the controller got
  std::uint64_t images_played = 0, images_late = 0, images_refused = 0;  ///< late: decoded after their time
  std::uint64_t readings_refused = 0;                                    ///< by the kernel, as images
};

/// Of a flight that goes on.
struct Progress {
  double share = 0;    ///< of what is to be played
  bool waits = false;  ///< for the process that flies
};

/// Plays, flies (unless beside), judges. Fails if and only if data set, configuration or a device is wrong, the system
/// has no thread left, or the process beside did not come; a flight that a controller would refuse is a result. `watch`
/// is called twenty times a second, and ends it by returning false; so do SIGINT, SIGTERM and SIGHUP.
Result<HilResult> run_hil(const HilOptions& options, const std::function<bool(const Progress&)>& watch);

}  // namespace epiline::hil
