#pragma once
// Plays a recorded flight through the real interfaces into a live run, and sends its odometry to a model of a flight
// controller. Page: docs/hil.md.
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
  std::string camera = "file";   ///< or v4l2loopback:DEVICE, or with a device for each camera: v4l2loopback:A,B
  std::string imu = "file";      ///< or uhid, mavlink
  /// Or pty:PATH, udp, udp:PORT, a CAN interface, or a serial port that is wired to the configured one.
  std::string controller = "pty";
  /// True: another process flies, with the same configuration file. Playing begins when that process has opened the
  /// IMU.
  bool beside = false;
  Releases judge = kUsualReleases;  ///< whose rules count
  double start_s = 0, duration_s = std::numeric_limits<double>::infinity();
  Disturbance disturbance;
};

struct HilResult {
  std::optional<FlightRecord> record;  ///< none if another process flew
  Verdict verdict;
  std::vector<Trajectory> received;  ///< poses that the controller received, one part for each reset counter
  Trajectory truth;                  ///< empty: no ground truth
  HostStamp begin;                   ///< of the flight; the verdict's times count from here
  std::uint64_t estimates = 0;       ///< that the controller received
  std::uint64_t images_played = 0, images_late = 0, images_refused = 0;  ///< late: decoded after their time
  std::uint64_t readings_refused = 0;                                    ///< by the kernel, as images
};

/// Progress of a running flight.
struct Progress {
  double share = 0;    ///< played share of the recording, 0 to 1
  bool waits = false;  ///< still waiting for the process that flies
};

/// Plays the recording, flies it (unless `beside`) and judges the odometry. Fails if and only if the data set, the
/// configuration or a device is wrong, the system cannot start a thread, or the other process did not open the IMU. A
/// flight that a controller would reject is a result, not a failure. `watch` is called twenty times a second. A signal
/// that ends a flight ends the run.
Result<HilResult> run_hil(const HilOptions& options, const std::function<void(const Progress&)>& watch);

}  // namespace epiline::hil
