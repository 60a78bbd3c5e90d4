#pragma once
// A recorded flight through the pipeline: in one thread as fast as possible, or in threads in real time.
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/flights/recordings/bag_dataset.h"
#include "drivers/flights/recordings/fault_injection.h"
#include "drivers/flights/recordings/flight_plan.h"
#include "drivers/study/replay/flight_view.h"
#include "drivers/study/report/flight_record.h"
#include "pipeline/config/config.h"
#include "pipeline/realtime/flight_observer.h"
#include "platform/error/result.h"

namespace epiline {

/// cam0 with cam1 beside it.
inline constexpr const char *kBothCameras = "both", *kAllCameras = "all";

struct ReplayOptions : FlightPart {
  std::filesystem::path dataset;
  std::string camera = "cam0";  ///< cam0 to cam3, kBothCameras: cam0 and cam1, or kAllCameras
  BagTopics topics;
  std::filesystem::path config_file;       ///< empty: defaults
  std::vector<std::string> set;            ///< settings for ConfigFile::set(); override the file
  std::optional<double> deadline_ms;       ///< wins over the file
  std::optional<double> loop_s;            ///< repeats the flight until it has lasted this long
  std::optional<double> realtime_speed;    ///< in threads, seconds of the recording per second; none: in one thread
  bool imu_rate = false;                   ///< in threads: keep the odometry of every IMU reading
  std::vector<Fault> faults;               ///< faults of the sensors during the flight
  std::function<void(AslDataset&)> alter;  ///< changes samples or calibration before the flight; may be empty
  std::function<void(Config&)> tune;       ///< changes constants that are no settings, for studies; may be empty
  /// A tiny change of the input, to measure how much errors scatter by chance: skips this many images at the
  /// beginning, and adds this many times 1e-7 of itself to each measured force.
  int perturb = 0;
  OdometrySink* odometry = nullptr;     ///< gets the published odometry; in one thread the estimate of each image
  FlightObserver* observer = nullptr;   ///< gets samples, images, outcomes and tracks of the flight
  FlightView* view = nullptr;           ///< shows a flight in threads; open, not started
  std::filesystem::path record_folder;  ///< of the flight recorder, in threads only; overrides the file; empty: none
  bool record_images = false;
};

struct ReplayResult {
  FlightRecord record;
  std::vector<std::string> notes;  ///< for the user, a line each
};

/// Replays the flight. Calls `progress` with the number of finished and of all images. Fails if and only if
/// configuration, data set or an image is wrong (ErrorKind::kUsage); a flight without a single pose is a result.
Result<ReplayResult> replay(const ReplayOptions& options,
                            const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace epiline
